"""Parameter sets that come with the package."""

import numpy as np

from .covariance import Covariance
from .parameters import FRICTION_SHARPNESS, THETA_NAMES, theta_vector
from .plant import PLANTS, Plant
from .rigid_body import RigidBody

TABLE_3 = Plant(
    theta=theta_vector([0.19717, 0.03909, 0.01746, 0.01187, 0.40808, 0.0108, 0.00267, 0.11456, 0.00732]),
    friction_sharpness=FRICTION_SHARPNESS,
    unit="V",
    u_max=10.0,
    provenance={
        "source": "Table 3 of the paper; the amplifier's voltage is taken as torque there, so θ is in volt units",
        "assumed": "r = 100 s/rad and u_max = 10 V are not printed in the paper",
    },
)

QUBE = Plant(
    theta=RigidBody(
        J1=1.10e-4,
        L1=0.085,
        m2=0.024,
        l2=0.0645,
        J2=0.024 * 0.129**2 / 12.0,
        Fv1=2.5e-4,
        Fv2=1.0e-5,
        Fc1=6.0e-4,
        Fc2=1.5e-5,
        gain=8.4 / 0.042,
    ).theta(),
    friction_sharpness=FRICTION_SHARPNESS,
    unit="V",
    u_max=10.0,
    sample_time=0.004,
    provenance={
        "source": "a rotary pendulum of the size of Quanser's QUBE-Servo 2: lengths and masses as its manual gives "
        "them, motor R/k = 8.4/0.042 V/(N·m), the arm's inertia and friction as such rigs show them (assumed)"
    },
)

LARGE_RIG = Plant(
    theta=RigidBody(
        J1=0.030,
        L1=0.25,
        m2=0.20,
        l2=0.25,
        J2=0.20 * 0.50**2 / 12.0,
        Fv1=0.015,
        Fv2=0.0012,
        Fc1=0.08,
        Fc2=0.004,
    ).theta(),
    friction_sharpness=FRICTION_SHARPNESS,
    unit="N·m",
    u_max=6.0,
    provenance={"source": "a table-top rig with a half-metre rod and a direct-drive motor (assumed values)"},
)

PLANTS.update({"table3": TABLE_3, "qube": QUBE, "large": LARGE_RIG})

SPREAD = 0.05
"""Standard deviation of each θ of a set above over its value, where plants are to be drawn: an assumption, as nobody
has measured how sure these values are."""


def with_spread(plant: Plant) -> Plant:
    """One of the sets above with independent θ of standard deviation SPREAD; any other plant as it is."""
    if plant not in PLANTS.values():
        return plant
    return plant.replace(covariance=Covariance(THETA_NAMES, np.diag((SPREAD * plant.theta) ** 2)))


# The gain of Eq. (24), to be used as u = −K x (errata, row 4).
PAPER_GAIN = 0.8 * np.array([-9.1265, -5.2953, -41.5431, -5.6176])
PAPER_GAIN.setflags(write=False)
