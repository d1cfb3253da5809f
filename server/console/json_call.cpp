#include "server/console/json_call.h"

#include <fmt/format.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/dynamic_message.h>
#include <google/protobuf/util/json_util.h>

#include <nlohmann/json.hpp>

#include "core/base/status.h"
#include "core/service/service.h"

namespace glasswing {
namespace {

namespace pb = google::protobuf;
constexpr auto kForever = std::chrono::system_clock::time_point::max();

std::unique_ptr<pb::Message> made(const pb::Descriptor* type) {
  return std::unique_ptr<pb::Message>(pb::MessageFactory::generated_factory()->GetPrototype(type)->New());
}

std::string bytes_of(const grpc::ByteBuffer& buffer) {
  std::vector<grpc::Slice> slices;
  std::string bytes;
  if (!buffer.Dump(&slices).ok()) return bytes;
  bytes.reserve(buffer.Length());
  for (const grpc::Slice& slice : slices)
    bytes.append(reinterpret_cast<const char*>(slice.begin()), slice.size());
  return bytes;
}

}  // namespace

std::string JsonMethod::name() const {
  return fmt::format("{}/{}", descriptor->service()->name(), descriptor->name());
}

absl::StatusOr<JsonMethod> JsonMethod::find(const std::string& service, const std::string& method) {
  const pb::MethodDescriptor* found = pb::DescriptorPool::generated_pool()->FindMethodByName(
      fmt::format("glasswing.v1.{}.{}", service, method));
  if (found == nullptr) return absl::NotFoundError(fmt::format("there is no call {}/{}", service, method));
  if (found->client_streaming())
    return absl::UnimplementedError(
        fmt::format("{}/{} takes a stream of requests, which needs gRPC", service, method));
  return JsonMethod{found};
}

JsonCall::JsonCall(const std::shared_ptr<grpc::Channel>& channel, const JsonMethod& method)
    : method_(method), stub_(channel) {}

absl::StatusOr<std::unique_ptr<JsonCall>> JsonCall::start(const std::shared_ptr<grpc::Channel>& channel,
                                                          const JsonMethod& method,
                                                          const std::string& request,
                                                          const Metadata& metadata,
                                                          std::chrono::milliseconds timeout) {
  const std::unique_ptr<pb::Message> message = made(method.descriptor->input_type());
  const auto parsed = pb::util::JsonStringToMessage(request.empty() ? "{}" : request, message.get());
  if (!parsed.ok()) {
    return absl::InvalidArgumentError(fmt::format("{} needs a {} in JSON: {}", method.name(),
                                                  message->GetTypeName(), std::string(parsed.message())));
  }
  std::unique_ptr<JsonCall> self(new JsonCall(channel, method));
  set_deadline(self->context_, timeout);
  for (const auto& [key, value] : metadata) self->context_.AddMetadata(key, value);
  self->call_ = self->stub_.PrepareCall(
      &self->context_,
      fmt::format("/{}/{}", method.descriptor->service()->full_name(), method.descriptor->name()),
      &self->queue_);
  self->call_->StartCall(nullptr);
  bool ok = false;
  self->is_through(kForever, ok);
  if (ok) {
    const grpc::Slice slice(message->SerializeAsString());
    self->call_->WriteLast(grpc::ByteBuffer(&slice, 1), grpc::WriteOptions(), nullptr);
    self->is_through(kForever, ok);
  }
  return self;
}

JsonCall::~JsonCall() {
  context_.TryCancel();
  bool ok = false;
  if (reading_) is_through(kForever, ok);
  if (!finished_) finish();
  queue_.Shutdown();
  void* tag = nullptr;
  while (queue_.Next(&tag, &ok)) {
  }
}

bool JsonCall::is_through(std::chrono::system_clock::time_point deadline, bool& ok) {
  void* tag = nullptr;
  return queue_.AsyncNext(&tag, &ok, deadline) == grpc::CompletionQueue::GOT_EVENT;
}

void JsonCall::finish() {
  bool ok = false;
  call_->Finish(&status_, nullptr);
  is_through(kForever, ok);
  finished_ = true;
}

JsonCall::Got JsonCall::next(std::chrono::milliseconds wait, std::string& message) {
  if (finished_) return Got::kEnd;
  if (!reading_) call_->Read(&buffer_, nullptr);
  reading_ = true;
  bool ok = false;
  if (!is_through(std::chrono::system_clock::now() + wait, ok)) return Got::kNothingYet;
  reading_ = false;
  if (!ok) {
    finish();
    return Got::kEnd;
  }
  const std::unique_ptr<pb::Message> answer = made(method_.descriptor->output_type());
  message.clear();
  if (answer->ParseFromString(bytes_of(buffer_)) && pb::util::MessageToJsonString(*answer, &message).ok())
    return Got::kMessage;
  context_.TryCancel();
  finish();
  status_ = {grpc::StatusCode::INTERNAL,
             fmt::format("the answer of {} is not a {}", method_.name(), answer->GetTypeName())};
  return Got::kEnd;
}

absl::Status JsonCall::outcome(const std::string& peer) const {
  return from_grpc(status_, peer);
}

std::string json_of(const absl::Status& status) {
  return nlohmann::json{{"code", absl::StatusCodeToString(status.code())},
                        {"message", std::string(status.message())}}
      .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

int http_status(const absl::Status& status) {
  switch (status.code()) {
    case absl::StatusCode::kOk:
      return 200;
    case absl::StatusCode::kInvalidArgument:
    case absl::StatusCode::kOutOfRange:
      return 400;
    case absl::StatusCode::kUnauthenticated:
      return 401;
    case absl::StatusCode::kPermissionDenied:
      return 403;
    case absl::StatusCode::kNotFound:
      return 404;
    case absl::StatusCode::kAborted:
    case absl::StatusCode::kAlreadyExists:
    case absl::StatusCode::kFailedPrecondition:
      return 409;
    case absl::StatusCode::kResourceExhausted:
      return 429;
    case absl::StatusCode::kUnimplemented:
      return 501;
    case absl::StatusCode::kUnavailable:
      return 503;
    case absl::StatusCode::kDeadlineExceeded:
      return 504;
    default:
      return 500;
  }
}

}  // namespace glasswing
