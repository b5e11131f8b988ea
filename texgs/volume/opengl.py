"""Offscreen OpenGL, tried in a child process: incomplete drivers crash VTK."""

import os
import subprocess
import sys

from texgs.core.errors import DeviceError

ADVICE = (
    "install libegl1, libegl-mesa0 and libgl1-mesa-dri, or libosmesa6 with "
    "VTK_DEFAULT_OPENGL_WINDOW=vtkOSOpenGLRenderWindow"
)


def offscreen_opengl() -> str:
    """Return the name of the offscreen renderer, such as a GPU; choose it for this process, too."""
    os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")  # asks no X server
    command = [sys.executable, "-P", "-m", "texgs.volume.opengl"]
    try:
        child = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    except subprocess.TimeoutExpired as error:
        raise DeviceError(f"offscreen OpenGL: no answer within 60 s; {ADVICE}") from error
    lines = (child.stdout if child.returncode == 0 else child.stderr).strip().splitlines()
    if child.returncode == 0 and lines:
        return lines[-1]
    crash = f"died of signal {-child.returncode}" if child.returncode < 0 else "failed"
    reason = lines[-1] if lines and child.returncode > 0 else f"the probe {crash}"
    raise DeviceError(f"offscreen OpenGL: {reason}; {ADVICE}")


def probe() -> str:
    """Render one empty frame the way volumes are rendered, and name the window class and the driver."""
    from vtkmodules import vtkRenderingOpenGL2  # noqa: F401, registers the window classes
    from vtkmodules.vtkRenderingCore import vtkRenderWindow

    window = vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetSize(16, 16)
    window.Render()
    report = dict(line.split(":", 1) for line in window.ReportCapabilities().splitlines() if ":" in line)
    return f"{window.GetClassName()}, {report.get('OpenGL renderer string', 'unknown renderer').strip()}"


if __name__ == "__main__":
    print(probe())
