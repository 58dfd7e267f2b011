"""How numba compiles the mapper's kernels, and where the machine code is kept."""

import hashlib
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba

F = TypeVar("F", bound=Callable[..., Any])

_KERNELS = Path(__file__).parent / "slam"


def _cache_directory() -> str:
    """A folder for this very version of the kernels, under NUMBA_CACHE_DIR or the user's cache.

    numba looks only at the file of the kernel it compiles: where a kernel that it calls changed in
    another file, it would go on using the old machine code. A folder per version of all the
    sources rules that out. Where nothing can be written at home, the system's folder for temporary
    files serves.
    """
    digest = hashlib.sha256()
    for source in sorted(_KERNELS.rglob("*.py")):
        digest.update(source.read_bytes())
    own = f"gridwright-kernels-{digest.hexdigest()[:16]}"
    home_cache = os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()
    for base in (os.environ.get("NUMBA_CACHE_DIR"), home_cache, tempfile.gettempdir()):
        if base:
            try:
                Path(base, own).mkdir(parents=True, exist_ok=True)
            except OSError:
                continue
            if os.access(Path(base, own), os.W_OK):
                return str(Path(base, own))
    return ""  # numba's own choice; it will say why it cannot write


numba.config.CACHE_DIR = _cache_directory()  # type: ignore[attr-defined]


def kernel(function: F) -> F:
    """Compiles `function` on its first call, without the GIL, and caches the machine code.

    No fastmath, for it changes bits between CPU types; no parallel=True, for numba's default
    threading layer aborts when two sessions enter it at once: threads take whole particles.
    """
    return numba.njit(cache=True, nogil=True, error_model="numpy")(function)  # type: ignore[return-value]
