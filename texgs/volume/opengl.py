"""Whether offscreen OpenGL works here: tried in a child process, because incomplete drivers crash VTK."""

import ctypes
import importlib.util
import subprocess
import sys

from texgs.core.errors import DeviceError

ADVICE = (
    "install libegl1, libegl-mesa0 and libgl1-mesa-dri, or libosmesa6 with "
    "VTK_DEFAULT_OPENGL_WINDOW=vtkOSOpenGLRenderWindow"
)

EGL_PLATFORM_SURFACELESS_MESA = 0x31DD
EGL_VENDOR = 0x3053


def offscreen_opengl() -> str:
    """What renders offscreen, such as the name of a GPU.

    Raises:
        DeviceError: if nothing does; says which packages to install.
    """
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


def through_vtk() -> str:
    """Render one empty frame the way volumes are rendered, and name the window class."""
    from vtkmodules import vtkRenderingOpenGL2  # noqa: F401, registers the window classes
    from vtkmodules.vtkRenderingCore import vtkRenderWindow

    window = vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetSize(16, 16)
    window.Render()
    report = dict(line.split(":", 1) for line in window.ReportCapabilities().splitlines() if ":" in line)
    return f"{window.GetClassName()}, {report.get('OpenGL renderer string', 'unknown renderer').strip()}"


def through_egl() -> str:
    """Open a display without a screen, and name the vendor and version."""
    egl = ctypes.CDLL("libEGL.so.1")
    egl.eglGetPlatformDisplay.restype = ctypes.c_void_p
    egl.eglGetPlatformDisplay.argtypes = [ctypes.c_uint, ctypes.c_void_p, ctypes.c_void_p]
    egl.eglGetDisplay.restype = ctypes.c_void_p
    egl.eglGetDisplay.argtypes = [ctypes.c_void_p]
    egl.eglInitialize.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p]
    egl.eglQueryString.restype = ctypes.c_char_p
    egl.eglQueryString.argtypes = [ctypes.c_void_p, ctypes.c_int]
    displays = (
        egl.eglGetPlatformDisplay(EGL_PLATFORM_SURFACELESS_MESA, None, None),
        egl.eglGetDisplay(None),
    )
    major, minor = ctypes.c_int(), ctypes.c_int()
    for display in displays:
        if display and egl.eglInitialize(display, ctypes.byref(major), ctypes.byref(minor)):
            vendor = egl.eglQueryString(display, EGL_VENDOR).decode()
            return f"EGL {major.value}.{minor.value}, {vendor}"
    raise OSError("libEGL is there, but no driver answers")


def through_osmesa() -> str:
    """Create a context in memory."""
    mesa = ctypes.CDLL("libOSMesa.so.8")
    mesa.OSMesaCreateContext.restype = ctypes.c_void_p
    if not mesa.OSMesaCreateContext(0x1908, None):  # GL_RGBA
        raise OSError("libOSMesa is there, but creates no context")
    return "OSMesa"


def probe() -> str:
    """What answers: VTK where it is installed, else EGL, else OSMesa."""
    if importlib.util.find_spec("vtkmodules"):
        return through_vtk()
    if sys.platform != "linux":
        return "provided by the system, not tried without VTK"
    problems = []
    for attempt in (through_egl, through_osmesa):
        try:
            return attempt()
        except (OSError, AttributeError) as error:
            problems.append(str(error))
    raise OSError("; ".join(problems))


if __name__ == "__main__":
    try:
        print(probe())
    except OSError as error:
        sys.exit(str(error))
