import os
import signal
import subprocess
import sys

import pytest

from unilavira_drake import rendering_check
from unilavira_drake.errors import RenderingError
from unilavira_drake.rendering_check import PACKAGES, check_rendering, diagnose


def fake(script):
    return [sys.executable, "-c", script]


def test_this_machine_renders():
    check_rendering()


@pytest.mark.parametrize(
    ("script", "package"),
    [
        (
            "raise ImportError('libglib-2.0.so.0: cannot open shared object file')",
            "libglib2.0-0",
        ),
        (
            "raise RuntimeError('could not initialize EGL by loading libEGL.so.1')",
            "libegl1",
        ),
        ("import os; os.kill(os.getpid(), 11)", "libgl1-mesa-dri"),
        (
            "import os, sys; print('Failed to initialize OpenGL functions!', file=sys.stderr,"
            " flush=True); os.kill(os.getpid(), 11)",
            "libgl1-mesa-dri",
        ),
        ("import os; os.abort()", "libgl1-mesa-dri"),
    ],
)
def test_each_missing_package_is_named_with_the_command(script, package):
    with pytest.raises(RenderingError) as error:
        check_rendering(fake(script))
    text = str(error.value)
    assert package in text.split("Install")[0]
    assert f"apt-get install -y --no-install-recommends {' '.join(PACKAGES)}" in text


def test_a_missing_driver_on_this_machine_is_an_error_and_no_crash():
    command = [sys.executable, "-m", "unilavira_drake.rendering_check"]
    blind = ["env", "LIBGL_DRIVERS_PATH=/nonexistent", "__EGL_VENDOR_LIBRARY_DIRS=/nonexistent"]
    with pytest.raises(RenderingError, match="libgl1-mesa-dri"):
        check_rendering([*blind, *command])


def test_other_failures_show_their_last_line():
    with pytest.raises(RenderingError, match=r"exit code 1\): the test picture is wrong"):
        check_rendering(fake("raise SystemExit('the test picture is wrong')"))
    with pytest.raises(RenderingError, match="pip install drake"):
        check_rendering(fake("raise ModuleNotFoundError(\"No module named 'pydrake'\")"))
    with pytest.raises(RenderingError, match="no output"):
        check_rendering(fake("raise SystemExit(3)"))


def test_a_renderer_that_hangs_is_given_up():
    with pytest.raises(RenderingError, match="not ready after 0 s"):
        check_rendering(fake("import time; time.sleep(60)"), timeout=0.3)


def test_success_needs_the_word_and_the_code():
    assert diagnose(0, "rendering works\n", "") == ""
    assert diagnose(0, "", "") != ""
    assert "crashed" in diagnose(-signal.SIGSEGV, "", "")


def test_the_check_itself_needs_no_drake():
    script = (
        "import sys; sys.modules['pydrake'] = None; import unilavira_drake.rendering_check as c; "
        "print(c.REMEDY)"
    )
    done = subprocess.run(
        fake(script), capture_output=True, text=True, env=dict(os.environ), check=True
    )
    assert done.stdout.strip() == rendering_check.REMEDY
