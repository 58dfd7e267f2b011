"""What a call to the server can fail with."""

from collections.abc import Mapping
from typing import Any

import grpc
from google.rpc.error_details_pb2 import BadRequest, ErrorInfo
from grpc_status import rpc_status


class GridwrightRpcError(Exception):
    """A call that the server refused, or that did not reach it.

    `reason` and `metadata` are those of google.rpc.ErrorInfo (empty where the server sent none),
    `violations` maps each field that broke a rule to what is wrong with it.
    """

    def __init__(self, cause: Any) -> None:
        """`cause` is what the call raised: both a grpc.RpcError and a grpc.Call."""
        self.code: grpc.StatusCode = cause.code()
        self.reason = ""
        self.metadata: Mapping[str, str] = {}
        self.violations: Mapping[str, str] = {}
        self._read_details(cause)
        name = f"{self.code.name} {self.reason}".rstrip()
        super().__init__(f"{name}: {cause.details()}")

    @property
    def retryable(self) -> bool:
        """True where the same call may succeed later."""
        return self.code is grpc.StatusCode.UNAVAILABLE

    def _read_details(self, cause: grpc.Call) -> None:
        status = rpc_status.from_call(cause)
        for detail in status.details if status else ():
            info, bad_request = ErrorInfo(), BadRequest()
            if detail.Unpack(info):
                self.reason, self.metadata = info.reason, dict(info.metadata)
            elif detail.Unpack(bad_request):
                self.violations = {
                    violation.field: violation.description for violation in bad_request.field_violations
                }
