#include "core/archive/raw_call.h"

#include <utility>

namespace glasswing {

RawCall::RawCall(const std::shared_ptr<grpc::Channel>& channel, const std::string& method,
                 const google::protobuf::MessageLite& request, std::chrono::milliseconds patience,
                 std::stop_token stop)
    : patience_(patience),
      call_(grpc::GenericStub(channel).PrepareCall(&context_, "/glasswing.v1.ArchiveService/" + method,
                                                   &queue_)),
      cancel_(std::move(stop), [this] { context_.TryCancel(); }) {
  const grpc::Slice serialized(request.SerializeAsString());
  const grpc::ByteBuffer bytes(&serialized, 1);
  call_->StartCall(this);
  if (!wait()) return;
  call_->WriteLast(bytes, grpc::WriteOptions(), this);
  wait();
}

RawCall::~RawCall() {
  if (open_) {
    context_.TryCancel();
    finish();
  }
  queue_.Shutdown();
  void* tag = nullptr;
  bool ok = false;
  while (queue_.Next(&tag, &ok)) {
  }
}

bool RawCall::wait() {
  void* tag = nullptr;
  bool ok = false;
  const auto deadline = std::chrono::system_clock::now() + patience_;
  if (queue_.AsyncNext(&tag, &ok, deadline) == grpc::CompletionQueue::TIMEOUT) {
    silent_ = true;
    context_.TryCancel();
    queue_.Next(&tag, &ok);
  }
  return ok;
}

bool RawCall::next(grpc::ByteBuffer& message) {
  call_->Read(&message, this);
  return wait();
}

grpc::Status RawCall::finish() {
  grpc::Status status;
  open_ = false;
  call_->Finish(&status, this);
  wait();
  if (silent_) return grpc::Status(grpc::StatusCode::UNAVAILABLE, "it sends nothing");
  return status;
}

}  // namespace glasswing
