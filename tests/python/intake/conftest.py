"""The command on logs of two tubes, and the truth that it must find."""

import lab_logs
import numpy as np
import pytest
from ctcr.table import measurements


@pytest.fixture(scope="module")
def truth():
    return lab_logs.truth()


@pytest.fixture
def log(tmp_path):
    """log(text): the path of a log."""

    def write(content: str | bytes, name: str = "log.csv", encoding: str = "utf-8"):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode(encoding))
        return path

    return write


@pytest.fixture
def imported(run, tmp_path):
    """imported(log, options...): the table that the command writes, and what it says."""

    def command(path, *arguments, tubes=2):
        target = tmp_path / "measurements.csv"
        code, out, err = run("import", path, "-o", target, *arguments)
        assert code == 0, err
        return measurements.load(target, tubes), out

    return command


@pytest.fixture
def refused(run, tmp_path):
    """refused(log, options...): the error, after which there is no table."""

    def command(path, *arguments):
        target = tmp_path / "refused.csv"
        code, _, err = run("import", path, "-o", target, *arguments)
        assert code in (1, 2) and not target.exists()
        return err

    return command


@pytest.fixture
def same(truth):
    """same(table, ...): asserts that a table holds the truth, up to the digits of the log."""

    def check(table, kept=slice(None), *, time=True, orientation=True, force=False, run=False):
        if time:
            np.testing.assert_allclose(np.diff(table.t), np.diff(truth.t[kept]), atol=2e-6)
        np.testing.assert_allclose(table.beta, truth.beta[kept], atol=1e-9)
        np.testing.assert_allclose(table.alpha, truth.alpha[kept], atol=1e-9)
        np.testing.assert_allclose(table.positions, truth.position[kept], atol=1e-9)
        if run:
            np.testing.assert_array_equal(table.run, truth.run[kept])
        if force:
            np.testing.assert_allclose(table.force, truth.force[kept], atol=1e-9)
        if orientation:
            cosine = np.abs(np.sum(table.quaternions * truth.quaternion[kept], axis=1))
            np.testing.assert_allclose(cosine, 1, atol=1e-9)

    return check
