"""Model (5) and the active effects carried in time: rates, and Runge–Kutta steps under a command that holds.

Every kernel works on *lanes*: L plants side by side, arrays of shape (rows, L). One env is L = 1, a batch of envs
L = N, and the sensitivities of an estimator are lanes with shifted states and parameters.

    X  (4 + memory, L)   q1, q2, v1 = q̇1, v2 = q̇2 [rad, rad/s], then the effects' memory
    P  (rows, L)         theta1 ... theta9, r1, r2, then the effects' parameters: see `layout`
    codes (n, 3)         the active effects: number in the library, first row in P, first row of memory in X
"""

from .compiled import compiled, lanes_of
from .dynamics import acceleration
from .effects.dispatch import (
    add_torques,
    adds_torques,
    changes_memory,
    changes_motion,
    changes_theta,
    filter_command,
    memory_rates,
    modify_theta,
    update_memory,
)
from .layout import N_BASE


@compiled(apart=True)
def _accelerate(X, F, TH, K):
    """Speeds and accelerations to the first rows of K, at states X under torques F (2, L)."""
    for k in range(X.shape[1]):
        K[0, k] = X[2, k]
        K[1, k] = X[3, k]
        a1, a2 = acceleration(
            X[1, k],
            X[2, k],
            X[3, k],
            F[0, k],
            F[1, k],
            TH[0, k],
            TH[1, k],
            TH[2, k],
            TH[3, k],
            TH[4, k],
            TH[5, k],
            TH[6, k],
            TH[7, k],
            TH[8, k],
            TH[9, k],
            TH[10, k],
        )
        K[2, k] = a1
        K[3, k] = a2


@compiled(apart=True)
def _to_stage(XS, S, X, K, h, w, ahead):
    """All rows on to the next Runge–Kutta stage: S += w K, from nothing where w = 1, and XS = X + ahead h K."""
    first = w == 1.0
    for row in range(X.shape[0]):
        for k in range(X.shape[1]):
            rate = K[row, k]
            S[row, k] = rate if first else S[row, k] + w * rate
            XS[row, k] = X[row, k] + ahead * h[k] * rate


@compiled(apart=True)
def _to_end(X, S, K, h):
    """All rows to the end of the Runge–Kutta step."""
    for row in range(X.shape[0]):
        for k in range(X.shape[1]):
            X[row, k] += h[k] * (1.0 / 6.0) * (S[row, k] + K[row, k])


@compiled(apart=True)
def _sources(F0, F1, ts, since, tau, W0, W1, t, h, ahead, lanes):
    """Torques before any effect adds to them, and the time of a stage `ahead` steps from the beginning."""
    for k in range(lanes):
        since[k] = ahead * h[k]
        ts[k] = t[k] + since[k]
        F0[k] = W0[k] + tau[k]
        F1[k] = W1[k]


@compiled
def rates(t, X, tau, W, P, codes, TH, F, K):
    """K = dX/dt at times t (L,), with the actuator's torque tau (L,) and disturbance torques W (2, L).

    TH (N_BASE, L) and F (2, L) are work space.
    """
    for k in range(X.shape[1]):
        F[0, k] = W[0, k] + tau[k]
        F[1, k] = W[1, k]
    if codes.shape[0] == 0:
        _accelerate(X, F, P, K)
        return
    TH[:] = P[:N_BASE]
    modify_theta(t, P, codes, TH)
    add_torques(t, X, tau, P, codes, TH, F)
    _accelerate(X, F, TH, K)
    K[4:] = 0.0
    memory_rates(t, X, tau, P, codes, TH, K)


@compiled(borrows=True, forceinline=True)
def runge_kutta(X, t, h, n, command, W, P, codes, work):
    """n classical Runge–Kutta steps of h (L,) seconds from t (L,), under a command held for all of them.

    The same sums as in `rates`; what no active effect asks for is done once and not in every stage.
    """
    if not changes_motion(codes):
        plain_steps(X, h, n, command, W, P)
        return
    rows, lanes = X.shape
    XS, K, S = work[:rows], work[rows : 2 * rows], work[2 * rows : 3 * rows]
    F, tau, ts, since = work[3 * rows + N_BASE : 3 * rows + N_BASE + 2], work[-3], work[-2], work[-4]
    filtered, remembered, pushed = True, rows > 4, adds_torques(codes)
    changed, carried = changes_theta(codes), rows > 4 and changes_memory(codes)
    TH = work[3 * rows : 3 * rows + N_BASE] if changed else P[:N_BASE]
    for row in range(4, rows):
        for k in range(lanes):
            K[row, k] = 0.0
    for k in range(lanes):
        tau[k] = command[k]
    for i in range(n):
        for stage in range(4):
            at = X if stage == 0 else XS
            c = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
            if filtered:
                for k in range(lanes):
                    since[k] = (i + c) * h[k]
                    tau[k] = command[k]
                filtered = filter_command(command, since, X, P, codes, tau)
            _sources(
                lanes_of(F, 0), lanes_of(F, 1), lanes_of(ts, 0), lanes_of(since, 0), lanes_of(tau, 0),
                lanes_of(W, 0), lanes_of(W, 1), lanes_of(t, 0), lanes_of(h, 0), i + c, lanes,
            )  # fmt: skip
            if changed:
                for row in range(N_BASE):
                    for k in range(lanes):
                        TH[row, k] = P[row, k]
                modify_theta(ts, P, codes, TH)
            if pushed:
                add_torques(ts, at, tau, P, codes, TH, F)
            _accelerate(at, F, TH, K)
            if carried:
                memory_rates(ts, at, tau, P, codes, TH, K)
            if stage == 3:
                _to_end(X, S, K, h)
            else:
                _to_stage(XS, S, X, K, h, 1.0 if stage == 0 else 2.0, 1.0 if stage == 2 else 0.5)
        if remembered:
            remembered = update_memory(X, P, codes)


@compiled(forceinline=True)
def plain_stages(q2, v1, v2, f1, f2, h, th1, th2, th3, th4, th5, th6, th7, th8, th9, r1, r2):
    """Stages two to four of a Runge–Kutta step of h seconds under torques f1, f2 alone, and all four accelerations.

    Returns the speeds (w1, w2, y1, y2, z1, z2) and the accelerations (a1, a2, b1, b2, c1, c2, d1, d2), stage by stage.
    """
    half = 0.5 * h
    a1, a2 = acceleration(q2, v1, v2, f1, f2, th1, th2, th3, th4, th5, th6, th7, th8, th9, r1, r2)
    w1, w2, x = v1 + half * a1, v2 + half * a2, q2 + half * v2
    b1, b2 = acceleration(x, w1, w2, f1, f2, th1, th2, th3, th4, th5, th6, th7, th8, th9, r1, r2)
    y1, y2, x = v1 + half * b1, v2 + half * b2, q2 + half * w2
    c1, c2 = acceleration(x, y1, y2, f1, f2, th1, th2, th3, th4, th5, th6, th7, th8, th9, r1, r2)
    z1, z2, x = v1 + h * c1, v2 + h * c2, q2 + h * y2
    d1, d2 = acceleration(x, z1, z2, f1, f2, th1, th2, th3, th4, th5, th6, th7, th8, th9, r1, r2)
    return w1, w2, y1, y2, z1, z2, a1, a2, b1, b2, c1, c2, d1, d2


@compiled
def plain_steps(X, h, n, command, W, P):
    """What `runge_kutta` does where no effect acts within the motion, the stages in registers: same bits, faster.

    n Runge–Kutta steps of h (L,) seconds of X (4, L), under the command (L,) and torques W (2, L).
    """
    for _ in range(n):
        for k in range(X.shape[1]):
            th1, th2, th3, th4, th5, th6 = P[0, k], P[1, k], P[2, k], P[3, k], P[4, k], P[5, k]
            th7, th8, th9, r1, r2 = P[6, k], P[7, k], P[8, k], P[9, k], P[10, k]
            step = h[k]
            sixth = step * (1.0 / 6.0)
            q1, q2, v1, v2 = X[0, k], X[1, k], X[2, k], X[3, k]
            w1, w2, y1, y2, z1, z2, a1, a2, b1, b2, c1, c2, d1, d2 = plain_stages(
                q2, v1, v2, W[0, k] + command[k], W[1, k], step, th1, th2, th3, th4, th5, th6, th7, th8, th9, r1, r2
            )
            X[0, k] = q1 + sixth * (((v1 + 2.0 * w1) + 2.0 * y1) + z1)
            X[1, k] = q2 + sixth * (((v2 + 2.0 * w2) + 2.0 * y2) + z2)
            X[2, k] = v1 + sixth * (((a1 + 2.0 * b1) + 2.0 * c1) + d1)
            X[3, k] = v2 + sixth * (((a2 + 2.0 * b2) + 2.0 * c2) + d2)


@compiled(nogil=True)
def shared_steps(X, tau, h, n, P):
    """`plain_steps` with one torque tau and one step h [s] for all lanes, as the filters of one log need them.

    The stages are summed in another order, so results agree with `advance` to rounding only.
    """
    for _ in range(n):
        for k in range(X.shape[1]):
            th1, th2, th3, th4, th5, th6 = P[0, k], P[1, k], P[2, k], P[3, k], P[4, k], P[5, k]
            th7, th8, th9, r1, r2 = P[6, k], P[7, k], P[8, k], P[9, k], P[10, k]
            q2, v1, v2 = X[1, k], X[2, k], X[3, k]
            w1, w2, y1, y2, z1, z2, a1, a2, b1, b2, c1, c2, d1, d2 = plain_stages(
                q2, v1, v2, tau, 0.0, h, th1, th2, th3, th4, th5, th6, th7, th8, th9, r1, r2
            )
            X[0, k] += h * (v1 + 2.0 * (w1 + y1) + z1) * (1.0 / 6.0)
            X[1, k] += h * (v2 + 2.0 * (w2 + y2) + z2) * (1.0 / 6.0)
            X[2, k] += h * (a1 + 2.0 * (b1 + c1) + d1) * (1.0 / 6.0)
            X[3, k] += h * (a2 + 2.0 * (b2 + c2) + d2) * (1.0 / 6.0)
