"""Whatever is sent by unary calls: no UNKNOWN, no INTERNAL, and the server stays well."""

import grpc
import pytest
from google.protobuf.descriptor import FieldDescriptor
from gridwright.v1 import mapping_service_pb2 as mapping
from gridwright.v1 import session_service_pb2 as sessions
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support import drive

INTEGERS = st.one_of(st.integers(0, 5), st.integers(0, 2**31 - 1))
NUMBERS = st.one_of(st.floats(-5.0, 5.0), st.floats(), st.just(0.0))
TEXTS = st.one_of(st.sampled_from(["", "a", "b", "laser"]), st.text(max_size=70))
BY_TYPE = {
    FieldDescriptor.CPPTYPE_UINT32: INTEGERS,
    FieldDescriptor.CPPTYPE_INT32: st.one_of(INTEGERS, st.integers(-(2**31), -1)),
    FieldDescriptor.CPPTYPE_UINT64: INTEGERS,
    FieldDescriptor.CPPTYPE_INT64: st.integers(-(2**63), 2**63 - 1),
    FieldDescriptor.CPPTYPE_DOUBLE: NUMBERS,
    FieldDescriptor.CPPTYPE_FLOAT: st.floats(width=32),
    FieldDescriptor.CPPTYPE_STRING: TEXTS,
}


def messages(message_type):
    """Messages of the type, each field set or not."""
    fields = {}
    for field in message_type.DESCRIPTOR.fields:
        if field.message_type is not None:
            value = messages(field.message_type._concrete_class)
        else:
            value = BY_TYPE[field.cpp_type]
        fields[field.name] = st.lists(value, max_size=5) if field.is_repeated else value
    return st.fixed_dictionaries({}, optional=fields).map(lambda values: message_type(**values))


ALLOWED = {
    grpc.StatusCode.OK,
    grpc.StatusCode.INVALID_ARGUMENT,
    grpc.StatusCode.NOT_FOUND,
    grpc.StatusCode.ALREADY_EXISTS,
    grpc.StatusCode.FAILED_PRECONDITION,
    grpc.StatusCode.RESOURCE_EXHAUSTED,
}
CALLS = [
    ("sessions", "CreateSession", sessions.CreateSessionRequest),
    ("sessions", "GetSession", sessions.GetSessionRequest),
    ("sessions", "ListSessions", sessions.ListSessionsRequest),
    ("sessions", "FinishSession", sessions.FinishSessionRequest),
    ("sessions", "DeleteSession", sessions.DeleteSessionRequest),
    ("mapping", "AddLaserScan", mapping.AddLaserScanRequest),
    ("mapping", "AddOdometry", mapping.AddOdometryRequest),
    ("mapping", "GetPose", mapping.GetPoseRequest),
]


@pytest.mark.parametrize(("stub", "method", "request_type"), CALLS, ids=[call[1] for call in CALLS])
def test_unary_calls(fake_server, stub, method, request_type):
    for session_id in ("a", "b"):
        fake_server.client.create_session(session_id)
        list(fake_server.client.stream(session_id, drive(3)))
    call = getattr(getattr(fake_server, stub), method)

    @settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
    @given(messages(request_type))
    def check(request):
        answer = call.future(request, timeout=20.0)
        assert answer.code() in ALLOWED, answer

    check()
    fake_server.client.wait_until_serving(5.0)
    for session in list(fake_server.client.list_sessions()):
        fake_server.client.delete_session(session.session_id)
    fake_server.client.create_session("well")
    assert len(list(fake_server.client.stream("well", drive(10)))) == 10


def test_stream_items(fake_server):
    """Any item gets a verdict, and none ends the stream."""
    fake_server.client.create_session("a")

    @settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.too_slow])
    @given(st.lists(messages(mapping.SensorItem), max_size=10))
    def check(items):
        first = fake_server.client.next_sequence_number("a")
        for number, item in enumerate(items, start=first):
            item.sequence_number = number
        verdicts = list(fake_server.client.stream("a", items))
        assert [verdict.sequence_number for verdict in verdicts] == [item.sequence_number for item in items]

    check()
    assert fake_server.client.get_session("a").state == sessions.SESSION_STATE_ACTIVE


@pytest.mark.parametrize("method", ["SessionService/CreateSession", "MappingService/AddLaserScan"])
def test_bytes_that_are_no_message(fake_server, method):
    call = fake_server.channel.unary_unary(f"/gridwright.v1.{method}")

    @settings(max_examples=150, deadline=None)
    @given(st.binary(max_size=100))
    def check(data):
        # gRPC itself answers INTERNAL to what does not decode.
        assert call.future(data, timeout=20.0).code() in ALLOWED | {grpc.StatusCode.INTERNAL}

    check()
    fake_server.client.wait_until_serving(5.0)
