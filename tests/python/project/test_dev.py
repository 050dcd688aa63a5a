"""The developer command itself, with stand-ins for what it calls."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
SETUP = 'say() { echo "$*"; }; quietly() { "$@"; }; system_packages() { :; }; setup() { :; }\n'
NICE = '#!/bin/bash\n[ $# = 0 ] && echo 0 && exit\nshift 2\n[ "$1" = nice ] && echo -15 && exit\nexec "$@"\n'  # of root
# Tests that wait, and leave a note when they begin, and when they are told to end.
PYTEST = f"""#!{sys.executable}
import pathlib, sys, time
me = pathlib.Path("bench" if "alone and not slow" in sys.argv else "others")
me.touch()
try:
    time.sleep(60)
except KeyboardInterrupt:
    me.with_suffix(".ended").touch()
    sys.exit(2)
"""


@pytest.mark.parametrize("jobs", [1, 2])
def test_interrupted(tmp_path, jobs):
    """Ctrl+C ends the tests of the simulated bench beside the others, and lets them clean up; on one core, where they
    come later, they do not begin."""
    stand_ins = {"tools/setup.sh": SETUP, "bin/nice": NICE, ".venv/bin/python": PYTEST}
    stand_ins |= {"bin/cmake": "#!/bin/sh\n", "bin/ctest": "#!/bin/sh\n"}
    for name, text in stand_ins.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        path.chmod(0o755)
    shutil.copy(ROOT / "tools/dev", tmp_path / "tools/dev")
    calls = {"JOBS": str(jobs), "PATH": f"{tmp_path / 'bin'}:{os.environ['PATH']}"}
    with subprocess.Popen([tmp_path / "tools/dev", "test"], env=os.environ | calls, start_new_session=True) as dev:
        deadline = time.monotonic() + 20
        while not ((tmp_path / "others").exists() and (jobs == 1 or (tmp_path / "bench").exists())):
            assert time.monotonic() < deadline and dev.poll() is None
            time.sleep(0.02)
        os.killpg(dev.pid, signal.SIGINT)  # as a terminal does
        assert dev.wait(timeout=20) == 130
    assert (tmp_path / "others.ended").exists()
    assert (tmp_path / "bench.ended").exists() == (tmp_path / "bench").exists() == (jobs == 2)
