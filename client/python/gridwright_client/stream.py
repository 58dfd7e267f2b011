"""The client's end of StreamSensorData."""

from collections.abc import Iterable, Iterator
from types import TracebackType
from typing import Any, Self

from gridwright.v1 import mapping_service_pb2 as mapping
from gridwright.v1.mapping_service_pb2_grpc import MappingServiceStub

from gridwright_client.items import batches


class SensorStream:
    """One open stream; gRPC draws the requests from a thread of its own while verdicts are read."""

    def __init__(
        self,
        stub: "MappingServiceStub[Any]",
        session_id: str,
        items: Iterable[mapping.SensorItem],
        want_poses: bool,
        batch_size: int,
    ) -> None:
        if batch_size < 1:
            raise ValueError(f"batch_size is {batch_size}, must be at least 1")
        self._start = mapping.StreamStart(session_id=session_id, want_poses=want_poses)
        self._items = items
        self._batch_size = batch_size
        self._items_error: Exception | None = None
        self._call = stub.StreamSensorData(self._requests())

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._call.cancel()  # of no effect on a call that has ended

    def next_sequence_number(self) -> int:
        """What the session expects next; ask before reading verdicts."""
        return int(next(self._call).ready.next_sequence_number)

    def verdicts(self) -> Iterator[mapping.ItemVerdict]:
        """One per item, in order; raises what `items` raised."""
        for response in self._call:
            yield from response.verdicts.verdicts
        if self._items_error is not None:
            raise self._items_error

    def _requests(self) -> Iterator[mapping.StreamSensorDataRequest]:
        yield mapping.StreamSensorDataRequest(start=self._start)
        for batch in batches(self._items_until_error(), self._batch_size):
            yield mapping.StreamSensorDataRequest(batch=batch)

    def _items_until_error(self) -> Iterator[mapping.SensorItem]:
        try:
            yield from self._items
        except Exception as error:  # gRPC would only log it and cancel the call
            self._items_error = error
