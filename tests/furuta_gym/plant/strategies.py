"""Random plants and states for property tests."""

import numpy as np
from hypothesis import strategies as st

angles = st.floats(-7.0, 7.0)
speeds = st.floats(-20.0, 20.0)
states = st.tuples(angles, angles, speeds, speeds)


@st.composite
def thetas(draw, friction: bool = True, consistent: bool = False) -> np.ndarray:
    """θ1…θ9 with M(q) > 0: θ3 stays below √(θ1 θ4); consistent ones also have θ4 ≥ θ2 and θ1 ≥ θ3²/θ2."""
    size = st.floats(1e-2, 1.0)
    th1, th4, th5 = draw(size), draw(size), draw(size)
    th2 = draw(st.floats(0.1, 0.95)) * th4 if consistent else draw(size)
    bound = np.sqrt(th1 * min(th2, th4)) if consistent else np.sqrt(th1 * th4)
    th3 = draw(st.floats(0.05, 0.9)) * bound
    losses = [draw(st.floats(0.0, 0.2)) if friction else 0.0 for _ in range(4)]
    return np.array([th1, th2, th3, th4, th5, *losses])
