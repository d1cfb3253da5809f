#include "console/routes/json_call.h"

#include <fmt/format.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/dynamic_message.h>
#include <google/protobuf/util/json_util.h>

#include "console/routes/json_bounds.h"
#include "core/base/status.h"
#include "core/service/message_limits.h"
#include "core/service/service.h"
#include "glasswing/v1/archive_service.pb.h"
#include "glasswing/v1/camera_service.pb.h"
#include "glasswing/v1/console_service.pb.h"
#include "glasswing/v1/display_service.pb.h"
#include "glasswing/v1/fleet_service.pb.h"
#include "glasswing/v1/live_service.pb.h"
#include "glasswing/v1/node_service.pb.h"
#include "glasswing/v1/queue_service.pb.h"
#include "glasswing/v1/rig_service.pb.h"
#include "glasswing/v1/session_service.pb.h"

namespace glasswing {
namespace {

namespace pb = google::protobuf;
constexpr auto kForever = std::chrono::system_clock::time_point::max();

// The pool has only files of which the program uses something.
void link_services() {
  (void)v1::GetManifestRequest::descriptor();   // ArchiveService
  (void)v1::GetCameraRequest::descriptor();     // CameraService
  (void)v1::CreateTokenRequest::descriptor();   // ConsoleService
  (void)v1::GetDisplayRequest::descriptor();    // DisplayService
  (void)v1::GetFleetRequest::descriptor();      // FleetService
  (void)v1::RunLiveRequest::descriptor();       // LiveService
  (void)v1::ListNodesRequest::descriptor();     // NodeService
  (void)v1::GetQueueRequest::descriptor();      // QueueService
  (void)v1::CheckRigRequest::descriptor();      // RigService
  (void)v1::ListSessionsRequest::descriptor();  // SessionService
}

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
  link_services();
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
                                                          const std::string& request, const Login* login,
                                                          const std::string& hold,
                                                          std::chrono::milliseconds timeout) {
  GW_RETURN_IF_ERROR(check_json_bounds(request));
  const std::unique_ptr<pb::Message> message = made(method.descriptor->input_type());
  const auto parsed = pb::util::JsonStringToMessage(request.empty() ? "{}" : request, message.get());
  if (!parsed.ok()) {
    return absl::InvalidArgumentError(fmt::format("{} needs a {} in JSON: {}", method.name(),
                                                  message->GetTypeName(), std::string(parsed.message())));
  }
  // What the callee would refuse, and drop the connection for, which all visitors share.
  GW_RETURN_IF_ERROR(check_limits(*message));
  constexpr size_t kMaxBytes = ServiceLimits{}.message_bytes;
  if (const size_t bytes = message->ByteSizeLong(); bytes > kMaxBytes) {
    return absl::InvalidArgumentError(
        fmt::format("the {} has {} bytes; it may have {}", message->GetTypeName(), bytes, kMaxBytes));
  }
  std::unique_ptr<JsonCall> self(new JsonCall(channel, method));
  set_deadline(self->context_, timeout);
  if (login != nullptr) call_for(*login, self->context_);
  if (!hold.empty()) self->context_.AddMetadata("glasswing-hold", hold);
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

}  // namespace glasswing
