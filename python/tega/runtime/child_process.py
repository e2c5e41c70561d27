"""Start programs of TEGA's own beside this one, and end them: by their input's end, by force only when they stay.

A log-out, ``systemctl stop`` or a shutdown sends SIGTERM and SIGHUP to every process at once. A program that
:func:`start_child` starts ignores both, as it ignores Ctrl-C: it ends in good order when its parent closes its input or
is gone.

``python -m`` would put the working folder first on the import path, where a file ``can.py`` would be run instead of the
package. A program that is started here finds the packages that this one finds, and nothing in the working folder.

Python objects go through pipes, pictures and samples as they lie. Both ends are this version of TEGA, started by one
person: nothing from outside comes through such a pipe.
"""

from __future__ import annotations

import contextlib
import gc
import os
import pickle
import struct
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from io import BufferedReader, BufferedWriter, FileIO
from pathlib import Path
from typing import Any, Final, TypeVar

_NEW_GROUP: Final = 0x200  # CREATE_NEW_PROCESS_GROUP, which `subprocess` names on Windows only
# The package's folder goes last: where it is the working folder itself, as in a checkout, nothing else there is
# found before the standard library and the installed packages.
_BEGIN: Final = (
    "import sys; root, module = sys.argv[1:3]; root in sys.path or sys.path.append(root); sys.argv[:3] = [module]; "
    "import runpy; runpy.run_module(module, run_name='__main__', alter_sys=True)"
)
# Before anything else is imported. Windows has SIGBREAK, which a closed console sends as well.
_IGNORE: Final = (
    "import signal; [signal.signal(getattr(signal, name), signal.SIG_IGN) for name in "
    "('SIGHUP', 'SIGINT', 'SIGTERM', 'SIGQUIT', 'SIGBREAK') if hasattr(signal, name)]; "
)

_COUNT = struct.Struct("<I")
_SIZE = struct.Struct("<Q")
_PIPE_BYTES = 1 << 20
_PROTOCOL = 5


def python_command(module: str, *arguments: str) -> list[str]:
    """Return the words that run a module of TEGA as a program of its own; start it with :func:`python_environment`."""
    root = str(Path(__file__).resolve().parents[2])
    return [sys.executable, "-P", "-c", _BEGIN, root, module, *arguments]


def start_child(module: str, *arguments: str, **popen: Any) -> subprocess.Popen[bytes]:
    """Start a module of TEGA as a program that only the end of its input ends.

    It has a process group of its own and, as its children do, ignores HUP, INT, TERM and QUIT from before its first
    import. The module has to read its standard input and end in good order when that ends.
    """
    words = python_command(module, *arguments)
    words[words.index(_BEGIN)] = _IGNORE + _BEGIN
    return subprocess.Popen(words, stdin=subprocess.PIPE, env=python_environment(), **own_group(), **popen)


def python_environment(environment: Mapping[str, str] | None = None) -> dict[str, str]:
    """Return the environment for such a program: without entries of ``PYTHONPATH`` that mean the working folder."""
    clean = dict(os.environ if environment is None else environment)
    entries = clean.pop("PYTHONPATH", "").split(os.pathsep)
    here = Path.cwd().resolve()
    kept = [entry for entry in entries if Path(entry).is_absolute() and Path(entry).resolve() != here]
    if kept:
        clean["PYTHONPATH"] = os.pathsep.join(kept)
    return clean


def own_group(system: str = sys.platform) -> dict[str, Any]:
    """Return the arguments of ``Popen`` for a program that the terminal's Ctrl-C and hang-up do not reach."""
    return {"creationflags": _NEW_GROUP} if system == "win32" else {"start_new_session": True}


@contextlib.contextmanager
def isolated_workers() -> Iterator[None]:
    """Keep the working folder off the import path of the workers that a pool of processes starts in this block."""
    before = os.environ.get("PYTHONSAFEPATH")
    os.environ["PYTHONSAFEPATH"] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ["PYTHONSAFEPATH"]
        else:
            os.environ["PYTHONSAFEPATH"] = before


def is_running(pid: int, module: str) -> bool:
    """Return whether a process runs a module of TEGA now, neither ended nor stopped; false without ``/proc``."""
    folder = Path(f"/proc/{pid}")
    try:
        state = folder.joinpath("stat").read_text("ascii", "replace").rpartition(") ")[2][:1]
        words = folder.joinpath("cmdline").read_bytes().split(b"\0")
    except OSError:
        return False
    return module.encode() in words and state not in {"T", "t", "Z", "X"}


def end_child(child: subprocess.Popen[bytes] | subprocess.Popen[str], patience_s: float) -> int:
    """Close a program's input, kill it if it outlasts ``patience_s``, and return its exit code."""
    if child.stdin is not None:
        with contextlib.suppress(OSError):  # it has ended, and words for it are left over
            child.stdin.close()
    try:
        return child.wait(patience_s)
    except subprocess.TimeoutExpired:
        child.kill()
        return child.wait()


class AnswerPipe:
    """Sends answers to the run, from any thread."""

    def __init__(self, pipe: BufferedWriter) -> None:
        self._pipe = pipe
        self._lock = threading.Lock()

    def say(self, *subject: Any) -> None:
        """Send one; nothing happens where the run was killed."""
        with self._lock, contextlib.suppress(OSError):
            send_object(self._pipe, subject)


def program_pipes() -> tuple[BufferedReader, AnswerPipe]:
    """Return, in a started program, the pipes for its requests and the answers; print() goes to standard error."""
    pipe = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    return os.fdopen(os.dup(sys.stdin.fileno()), "rb"), AnswerPipe(pipe)


def widen_pipe(pipe: BufferedWriter) -> None:
    """Let a pipe hold a mebibyte where the system allows it, so that a picture goes through in one piece."""
    if sys.platform == "linux":
        import fcntl

        with contextlib.suppress(OSError):  # it goes as it is
            fcntl.fcntl(pipe, fcntl.F_SETPIPE_SZ, _PIPE_BYTES)


def send_object(pipe: BufferedWriter, content: Any) -> None:
    """Write an object, arrays without a copy; ``OSError`` where the reader is gone."""
    arrays: list[pickle.PickleBuffer] = []
    head = pickle.dumps(content, _PROTOCOL, buffer_callback=arrays.append)
    parts = [memoryview(head), *(array.raw() for array in arrays)]
    pipe.write(_COUNT.pack(len(parts)) + b"".join(_SIZE.pack(part.nbytes) for part in parts))
    for part in parts:
        pipe.write(part)
    pipe.flush()


def receive_object(pipe: BufferedReader | FileIO) -> Any:
    """Read an object; ``EOFError`` where the other end is closed."""
    (n_parts,) = _COUNT.unpack(_exactly(pipe, _COUNT.size))
    sizes = [size for (size,) in _SIZE.iter_unpack(_exactly(pipe, n_parts * _SIZE.size))]
    head, *arrays = (_exactly(pipe, size) for size in sizes)
    return pickle.loads(head, buffers=arrays)


def _exactly(pipe: BufferedReader | FileIO, n_bytes: int) -> bytearray:
    data = bytearray(n_bytes)
    view, n_read = memoryview(data), 0
    while n_read < n_bytes:
        n = pipe.readinto(view[n_read:])
        if not n:
            raise EOFError
        n_read += n
    return data


Result = TypeVar("Result")


@contextlib.contextmanager
def called_beside(
    function: Callable[..., Result], *arguments: Any, lost: Exception
) -> Iterator[Callable[[], Result]]:
    """Begin a call of a module's function in a process, which ends with the block; yield a function that waits for it.

    Arguments and result have to be known to :mod:`pickle`. The waiting function raises what the call raised, or
    ``lost`` where the process ends without a result, as when memory is short.
    """
    child = start_child(__name__, stdout=subprocess.PIPE)
    assert isinstance(child.stdin, BufferedWriter)
    assert isinstance(child.stdout, BufferedReader)
    pipe = child.stdout

    def wait() -> Result:
        try:
            verb, found = receive_object(pipe)
        except EOFError:
            raise lost from None
        if verb == "failed":
            raise found
        result: Result = found
        return result

    try:
        send_object(child.stdin, (function, arguments))
        yield wait
    finally:
        end_child(child, 0.0)
        pipe.close()


def main() -> None:
    """Call the function that is asked for, and send its result."""
    requested, answers = program_pipes()
    function, arguments = receive_object(requested)

    def end_with_caller() -> None:
        requested.read()
        os._exit(1)

    threading.Thread(target=end_with_caller, daemon=True).start()
    gc.freeze()  # modules and types stay: the collector need not look at them again
    try:
        answers.say("done", function(*arguments))
    except Exception as error:  # who asked raises it
        answers.say("failed", error)


if __name__ == "__main__":
    main()
