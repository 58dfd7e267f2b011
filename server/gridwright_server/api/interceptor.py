"""Around every handler: refuses calls while the server is not serving, turns errors into status."""

import logging
import uuid
from collections.abc import Callable, Iterator
from typing import Any, NoReturn, TypeAlias

import grpc

from gridwright_server.api.status import internal_status, status_of
from gridwright_server.errors import GridwrightError

_HEALTH = "/grpc.health.v1.Health/"
_OWN = "/gridwright."

_MaybeHandler: TypeAlias = "grpc.RpcMethodHandler[Any, Any] | None"
_Handler: TypeAlias = "grpc.RpcMethodHandler[Any, Any]"

_logger = logging.getLogger(__name__)


class EdgeInterceptor(grpc.ServerInterceptor):
    """Lets no exception text and no UNKNOWN leave the server.

    `check_serving` raises a GridwrightError while Gridwright's own services must not be called.
    """

    def __init__(self, check_serving: Callable[[], None]) -> None:
        self._check_serving = check_serving

    def intercept_service(
        self,
        continuation: Callable[[grpc.HandlerCallDetails], _MaybeHandler],
        handler_call_details: grpc.HandlerCallDetails,
    ) -> _MaybeHandler:
        """Wraps the handler of the method called; health's own must answer always."""
        handler = continuation(handler_call_details)
        method = handler_call_details.method
        if handler is None or method.startswith(_HEALTH):
            return handler
        check = self._check_serving if method.startswith(_OWN) else _pass
        return _wrapped(handler, method, check)


def _pass() -> None:
    pass


def _wrapped(handler: Any, method: str, check: Callable[[], None]) -> _Handler:
    """The same handler, with errors turned into status."""

    def one(behavior: Any) -> Any:
        def call(request: Any, context: grpc.ServicerContext) -> Any:
            try:
                check()
                return behavior(request, context)
            except Exception as error:
                _abort(context, method, error)

        return call

    def many(behavior: Any) -> Any:
        def call(request: Any, context: grpc.ServicerContext) -> Iterator[Any]:
            try:
                check()
                yield from behavior(request, context)
            except Exception as error:
                _abort(context, method, error)

        return call

    serializers = (handler.request_deserializer, handler.response_serializer)
    if handler.unary_unary:
        return grpc.unary_unary_rpc_method_handler(one(handler.unary_unary), *serializers)
    if handler.unary_stream:
        return grpc.unary_stream_rpc_method_handler(many(handler.unary_stream), *serializers)
    if handler.stream_unary:
        return grpc.stream_unary_rpc_method_handler(one(handler.stream_unary), *serializers)
    return grpc.stream_stream_rpc_method_handler(many(handler.stream_stream), *serializers)


def _abort(context: grpc.ServicerContext, method: str, error: Exception) -> NoReturn:
    if isinstance(error, GridwrightError):
        _logger.info("%s refused: %s: %s", method, error.reason, error)
        context.abort_with_status(status_of(error))
    if not context.is_active():
        _logger.info("%s ended by the client", method)
        context.abort(grpc.StatusCode.CANCELLED, "ended by the client")
    incident = uuid.uuid4().hex[:12]
    _logger.exception("%s failed, incident %s", method, incident, exc_info=error)
    context.abort_with_status(internal_status(incident))
