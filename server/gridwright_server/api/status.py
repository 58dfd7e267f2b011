"""From the server's errors to gRPC status: one table."""

import grpc
from google.protobuf.any_pb2 import Any
from google.rpc.error_details_pb2 import BadRequest, ErrorInfo
from google.rpc.status_pb2 import Status
from grpc_status import rpc_status

from gridwright_server.errors import (
    AlreadyExistsError,
    FailedPreconditionError,
    GridwrightError,
    InvalidArgumentError,
    NotFoundError,
    OutOfRangeError,
    ResourceExhaustedError,
    UnavailableError,
)

CODES: dict[type[GridwrightError], grpc.StatusCode] = {
    InvalidArgumentError: grpc.StatusCode.INVALID_ARGUMENT,
    NotFoundError: grpc.StatusCode.NOT_FOUND,
    AlreadyExistsError: grpc.StatusCode.ALREADY_EXISTS,
    FailedPreconditionError: grpc.StatusCode.FAILED_PRECONDITION,
    OutOfRangeError: grpc.StatusCode.OUT_OF_RANGE,
    ResourceExhaustedError: grpc.StatusCode.RESOURCE_EXHAUSTED,
    UnavailableError: grpc.StatusCode.UNAVAILABLE,
}

_DOMAIN = "gridwright"
# Status travels in HTTP/2 trailers, of which a client takes 8 KiB by default.
_LONGEST_MESSAGE = 500
_MOST_VIOLATIONS = 30


def status_of(error: GridwrightError) -> grpc.Status:
    """The error with google.rpc.ErrorInfo and, for invalid fields, BadRequest."""
    details = [ErrorInfo(reason=error.reason, domain=_DOMAIN, metadata=error.metadata)]
    if isinstance(error, InvalidArgumentError):
        bad_request = BadRequest()
        for violation in error.violations[:_MOST_VIOLATIONS]:
            bad_request.field_violations.add(field=violation.field, description=violation.description)
        details.append(bad_request)
    return _status(CODES[type(error)], str(error), details)


def internal_status(incident: str) -> grpc.Status:
    """For an error that is no business of the client's: only a name to look it up by in the log."""
    info = ErrorInfo(reason="INTERNAL", domain=_DOMAIN, metadata={"incident": incident})
    return _status(grpc.StatusCode.INTERNAL, f"internal error, incident {incident}", [info])


def _status(code: grpc.StatusCode, message: str, details: list[ErrorInfo | BadRequest]) -> grpc.Status:
    status = Status(code=code.value[0], message=_shortened(message))
    for detail in details:
        packed = Any()
        packed.Pack(detail)
        status.details.append(packed)
    return rpc_status.to_status(status)


def _shortened(message: str) -> str:
    return message if len(message) <= _LONGEST_MESSAGE else f"{message[: _LONGEST_MESSAGE - 4]} ..."
