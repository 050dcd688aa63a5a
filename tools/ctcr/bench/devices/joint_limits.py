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

    def problem(self, joints: ArrayLike, slack_m: float = 1e-6, slack_rad: float = 1e-6) -> str | None:
        """Which limit the joints (2N,) [m], [rad] violate by more than the slack; None where they are allowed."""
        n = len(self.length)
        beta, alpha = np.asarray(joints, float)[:n], np.asarray(joints, float)[n:]
        if not np.isfinite(joints).all():
            return "a joint is not a number"
        ranges = (
            ("beta", "mm", 1e3, beta, self.travel, slack_m),
            ("alpha", "deg", 180 / np.pi, alpha, self.rotation, slack_rad),
        )
        for name, unit, scale, values, limits, slack in ranges:
            for i, (value, (low, high)) in enumerate(zip(values, limits, strict=True), start=1):
                if not low - slack <= value <= high + slack:
                    allowed = f"may be {scale * low:.2f} to {scale * high:.2f} {unit}"
                    return f"{name}{i} = {scale * value:.2f} {unit}: {allowed}"
        for i, gap in enumerate(np.diff(beta), start=1):
            if gap < self.clearance - slack_m:
                least = f"must be {1e3 * self.clearance:.2f} mm at least"
                return f"the carriages of tubes {i} and {i + 1} come too near: {1e3 * gap:.2f} mm, {least}"
        if beta[-1] > slack_m:
            return f"tube {n} would be grasped {1e3 * beta[-1]:.2f} mm in front of the plate"
        tip = self.length + beta
        if self.one_by_one and (tip > slack_m).sum() <= 1:
            return None
        for i, gap in enumerate(-np.diff(tip), start=1):
            if gap < -slack_m:
                return f"tube {i} would end {-1e3 * gap:.2f} mm inside tube {i + 1}: its tip must stand out"
        if tip[-1] < -slack_m:
            return f"the tip of tube {n} would be {-1e3 * tip[-1]:.2f} mm behind the plate"
        return None
