"""A gRPC client that knows nothing beforehand: services and messages come from server reflection."""

import functools

import grpc
from google.protobuf import descriptor_pool, json_format, message_factory
from google.rpc import error_details_pb2
from grpc_reflection.v1alpha.proto_reflection_descriptor_database import ProtoReflectionDescriptorDatabase
from grpc_status import rpc_status

SERVICE = "signorini.v1.JobService"


class Client:
    """`client.GetJob(id=…)` calls the method of that name; fields are given as in the JSON of protobuf."""

    def __init__(self, address, ca=None, known=None):
        """`ca`: the certificate of an authority, for TLS. `known`: another client of the same service, whose messages are used
        instead of asking for them: gRPC's own client may wait for ever, also beyond a time-out, for an answer of
        reflection if the server stops at that moment."""
        options = [("grpc.enable_http_proxy", 0)]
        if ca:
            trusted = grpc.ssl_channel_credentials(root_certificates=ca)
            self.channel = grpc.secure_channel(address, trusted, options=options)
        else:
            self.channel = grpc.insecure_channel(address, options=options)
        self.pool = known.pool if known else descriptor_pool.DescriptorPool(ProtoReflectionDescriptorDatabase(self.channel))
        self.service = self.pool.FindServiceByName(SERVICE)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.channel.close()

    def call_with_metadata(self, name, /, **fields):
        """The answer of a call, and its metadata."""
        request, call = self._stub(name)
        answer, state = call.with_call(json_format.ParseDict(fields, request()), timeout=120)
        return answer, dict((*state.initial_metadata(), *state.trailing_metadata()))

    @functools.lru_cache(maxsize=None)
    def _stub(self, name):
        method = self.service.methods_by_name[name]
        kinds = {
            (False, False): self.channel.unary_unary,
            (False, True): self.channel.unary_stream,
            (True, False): self.channel.stream_unary,
        }
        request = message_factory.GetMessageClass(method.input_type)
        answer = message_factory.GetMessageClass(method.output_type)
        path = "/%s/%s" % (SERVICE, name)
        call = kinds[method.client_streaming, method.server_streaming](
            path, request_serializer=request.SerializeToString, response_deserializer=answer.FromString
        )
        return request, call

    def __getattr__(self, name):
        if name not in self.service.methods_by_name:
            raise AttributeError("%s has no method %s" % (SERVICE, name))
        request, call = self._stub(name)
        return lambda timeout=120, **fields: call(json_format.ParseDict(fields, request()), timeout=timeout)


def as_json(message):
    """A message with the names of its .proto, as REST has them."""
    return json_format.MessageToDict(message, preserving_proto_field_name=True)


def refusal(call, *arguments, **fields):
    """What a call that must fail fails with: its code, and its google.rpc details by their names."""
    try:
        answer = call(*arguments, **fields)
        # a stream fails when it is read
        list(answer) if hasattr(answer, "__next__") else None
    except grpc.RpcError as error:
        details = {}
        for packed in rpc_status.from_call(error).details:
            kind = packed.type_url.rsplit(".", 1)[1]
            details[kind] = getattr(error_details_pb2, kind)()
            packed.Unpack(details[kind])
        return error.code().name, details
    raise AssertionError("a call that must fail was answered: %r" % answer)
