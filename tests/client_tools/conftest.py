"""Property tests here write files: on a busy machine one example may take long."""

from hypothesis import settings

settings.register_profile("files", deadline=None)
settings.load_profile("files")
