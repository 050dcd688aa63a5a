"""Where the joints may go: travel, rotation, and the order of the tubes."""

from dataclasses import dataclass

import numpy as np

from ctcr.arrays import Array, ArrayLike


@dataclass(frozen=True)
class JointLimits:
    """Limits of N tubes. All are linear in the joints: a straight move between two allowed positions is allowed.

    With `one_by_one` each tube may also stand out of the plate alone, whatever the order of the tips. From there a
    straight move to other positions may be forbidden; one by way of all tips flush is allowed.
    """

    length: Array  # (N,) [m], of the tubes
    travel: Array  # (N, 2) [m], lowest and highest beta
    rotation: Array  # (N, 2) [rad], lowest and highest alpha
    clearance: float  # [m] between neighbouring grasped points, the size of the carriages
    one_by_one: bool = False

    def excess(self, joints: ArrayLike, slack_m: float = 1e-6) -> Array:
        """By how much joints (2N,) violate each limit (6N,) [m], [rad]; negative: they keep it.

        `slack_m`: a tip that stands out no farther does not stand out.
        """
        n = len(self.length)
        beta, alpha = np.asarray(joints, float)[:n], np.asarray(joints, float)[n:]
        tip = self.length + beta
        behind = np.append(np.diff(tip), -tip[-1])  # the next tip, or the plate
        if self.one_by_one and (tip > slack_m).sum() <= 1:
            behind = np.minimum(behind, 0.0)
        low, high = self.travel.T
        least, most = self.rotation.T
        near = self.clearance - np.diff(beta)
        return np.concatenate([low - beta, beta - high, least - alpha, alpha - most, near, beta[-1:], behind])

    def problem(
        self, joints: ArrayLike, slack_m: float = 1e-6, slack_rad: float = 1e-6, allowed: ArrayLike = 0.0
    ) -> str | None:
        """Which limit the joints (2N,) [m], [rad] violate by more than the slack; None where they are allowed.

        `allowed`: an `excess` that counts as none, such as that of where the joints come from.
        """
        if not np.isfinite(joints).all():
            return "a joint is not a number"
        slack = np.repeat([slack_m, slack_rad, slack_m], 2 * len(self.length))
        over = np.flatnonzero(self.excess(joints, slack_m) > slack + allowed)
        return self._text(over[0], np.asarray(joints, float)) if len(over) else None

    def _text(self, limit: int, joints: Array) -> str:
        """Names the violated limit, an index of `excess`, with the present and the allowed values."""
        n = len(self.length)
        kind, tube = divmod(int(limit), n)
        i, beta, gap = tube + 1, 1e3 * joints[:n], 1e3 * self.excess(joints)[limit]
        if kind < 2:
            low, high = 1e3 * self.travel[tube]
            return f"beta{i} = {beta[tube]:.2f} mm: may be {low:.2f} to {high:.2f} mm"
        if kind < 4:
            low, high = np.rad2deg(self.rotation[tube])
            return f"alpha{i} = {np.rad2deg(joints[n + tube]):.2f} deg: may be {low:.2f} to {high:.2f} deg"
        if kind == 4 and i < n:
            least = f"must be {1e3 * self.clearance:.2f} mm at least"
            return f"the carriages of tubes {i} and {i + 1} come too near: {beta[i] - beta[tube]:.2f} mm, {least}"
        if kind == 4:
            return f"tube {n} would be grasped {gap:.2f} mm in front of the plate"
        if i < n:
            return f"tube {i} would end {gap:.2f} mm inside tube {i + 1}: its tip must stand out"
        return f"the tip of tube {n} would be {gap:.2f} mm behind the plate"
