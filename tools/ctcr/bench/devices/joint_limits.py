"""Where the joints may go: travel, rotation, and the order of the tubes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class JointLimits:
    """Limits of N tubes. All are linear in the joints: a straight move between two allowed places is allowed.

    With `one_by_one` each tube may also stand out of the plate alone, without the order of the tips. From such a place
    to others the straight way may be forbidden; that over the place where all tips are flush is allowed.
    """

    length: Array  # (N,) [m], of the tubes
    travel: Array  # (N, 2) [m], lowest and highest beta
    rotation: Array  # (N, 2) [rad], lowest and highest alpha
    clearance: float  # [m] between neighbouring grasped points, the size of the carriages
    one_by_one: bool = False

    def problem(self, joints: ArrayLike, slack_m: float = 1e-6, slack_rad: float = 1e-6) -> str | None:
        """What forbids the joints (2N,) [m], [rad], in words; None where they are allowed, within the slack."""
        n = len(self.length)
        beta, alpha = np.asarray(joints, float)[:n], np.asarray(joints, float)[n:]
        if not np.isfinite(joints).all():
            return "a joint is not a number"
        for i, (low, high) in enumerate(self.travel):
            if not low - slack_m <= beta[i] <= high + slack_m:
                return f"beta{i + 1} = {1e3 * beta[i]:.2f} mm: may be {1e3 * low:.2f} to {1e3 * high:.2f} mm"
        for i, (low, high) in enumerate(np.rad2deg(self.rotation)):
            angle = np.rad2deg(alpha[i])
            if not low - np.rad2deg(slack_rad) <= angle <= high + np.rad2deg(slack_rad):
                return f"alpha{i + 1} = {angle:.2f} deg: may be {low:.2f} to {high:.2f} deg"
        for i, gap in enumerate(np.diff(beta)):
            if gap < self.clearance - slack_m:
                return (
                    f"the carriages of tubes {i + 1} and {i + 2} come too near: {1e3 * gap:.2f} mm, "
                    f"must be {1e3 * self.clearance:.2f} mm at least"
                )
        if beta[-1] > slack_m:
            return f"tube {n} would be grasped {1e3 * beta[-1]:.2f} mm in front of the plate"
        tip = self.length + beta
        if self.one_by_one and (tip > slack_m).sum() <= 1:
            return None
        for i, gap in enumerate(-np.diff(tip)):
            if gap < -slack_m:
                return f"tube {i + 1} would end {-1e3 * gap:.2f} mm inside tube {i + 2}: its tip must stand out"
        if tip[-1] < -slack_m:
            return f"the tip of tube {n} would be {-1e3 * tip[-1]:.2f} mm behind the plate"
        return None
