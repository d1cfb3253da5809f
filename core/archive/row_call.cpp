#include "core/archive/row_call.h"

#include <grpcpp/impl/codegen/proto_utils.h>

#include <utility>

namespace glasswing {

RowCall::RowCall(const std::shared_ptr<grpc::Channel>& channel, const v1::ReadRowsRequest& request,
                 std::chrono::milliseconds patience, std::stop_token stop)
    : patience_(patience),
      call_(grpc::GenericStub(channel).PrepareCall(&context_, "/glasswing.v1.ArchiveService/ReadRows",
                                                   &queue_)),
      cancel_(std::move(stop), [this] { context_.TryCancel(); }) {
  grpc::ByteBuffer bytes;
  bool own = false;
  (void)grpc::SerializationTraits<v1::ReadRowsRequest>::Serialize(request, &bytes, &own);
  call_->StartCall(this);
  if (!wait()) return;
  call_->WriteLast(bytes, grpc::WriteOptions(), this);
  wait();
}

RowCall::~RowCall() {
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

bool RowCall::wait() {
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

bool RowCall::next(grpc::ByteBuffer& message) {
  call_->Read(&message, this);
  return wait();
}

grpc::Status RowCall::finish() {
  grpc::Status status;
  open_ = false;
  call_->Finish(&status, this);
  wait();
  if (silent_) return grpc::Status(grpc::StatusCode::UNAVAILABLE, "it sends nothing");
  return status;
}

}  // namespace glasswing
