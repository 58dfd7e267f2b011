"""gridwright.v1.SessionService: convert, call, convert."""

import grpc
from gridwright.v1 import session_service_pb2 as pb
from gridwright.v1.session_service_pb2_grpc import SessionServiceServicer

from gridwright_server.api.convert.checks import session_id_of
from gridwright_server.api.convert.sessions import page_of, session_message, spec_of
from gridwright_server.session.registry import SessionRegistry


class SessionServicer(SessionServiceServicer):
    """The life of sessions."""

    def __init__(self, registry: SessionRegistry) -> None:
        self._registry = registry

    def CreateSession(  # noqa: N802
        self, request: pb.CreateSessionRequest, context: grpc.ServicerContext
    ) -> pb.CreateSessionResponse:
        """Starts a map."""
        session = self._registry.create(spec_of(request))
        return pb.CreateSessionResponse(session=session_message(session))

    def GetSession(  # noqa: N802
        self, request: pb.GetSessionRequest, context: grpc.ServicerContext
    ) -> pb.GetSessionResponse:
        """The session as it stands."""
        session = self._registry.get(session_id_of(request.session_id))
        return pb.GetSessionResponse(session=session_message(session))

    def ListSessions(  # noqa: N802
        self, request: pb.ListSessionsRequest, context: grpc.ServicerContext
    ) -> pb.ListSessionsResponse:
        """A page of sessions; its token is the last id on it."""
        after, size = page_of(request)
        sessions, more = self._registry.page(after, size)
        return pb.ListSessionsResponse(
            sessions=[session_message(session) for session in sessions],
            next_page_token=sessions[-1].spec.session_id if more else "",
        )

    def FinishSession(  # noqa: N802
        self, request: pb.FinishSessionRequest, context: grpc.ServicerContext
    ) -> pb.FinishSessionResponse:
        """Answers when all that was queued has been processed."""
        session = self._registry.get(session_id_of(request.session_id))
        session.finish()
        return pb.FinishSessionResponse(session=session_message(session))

    def DeleteSession(  # noqa: N802
        self, request: pb.DeleteSessionRequest, context: grpc.ServicerContext
    ) -> pb.DeleteSessionResponse:
        """Drops the session and what is stored of it."""
        self._registry.delete(session_id_of(request.session_id))
        return pb.DeleteSessionResponse()
