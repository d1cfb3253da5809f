// ArchiveService over an ArchiveStore.
#pragma once

#include <stop_token>

#include "core/archive/archive_store.h"
#include "core/service/joined_calls.h"
#include "glasswing/v1/archive_service.grpc.pb.h"

namespace glasswing {

class ArchiveServiceImpl final
    : public v1::ArchiveService::WithRawCallbackMethod_ReadRows<v1::ArchiveService::Service> {
 public:
  explicit ArchiveServiceImpl(ArchiveStore& store) : store_(store) {}
  // Cancels running copies, so that the daemon can stop.
  void stop() { stopping_.request_stop(); }

  grpc::Status CreateArchive(grpc::ServerContext*, const v1::CreateArchiveRequest*,
                             v1::CreateArchiveResponse*) override;
  grpc::Status ShareFrames(grpc::ServerContext*, const v1::ShareFramesRequest*,
                           v1::ShareFramesResponse*) override;
  grpc::Status GetManifest(grpc::ServerContext*, const v1::GetManifestRequest*,
                           v1::GetManifestResponse*) override;
  // Raw, so that pixels go directly from mapped files to the connection. Sends one message at a time, which
  // bounds the memory that a slow reader holds.
  grpc::ServerWriteReactor<grpc::ByteBuffer>* ReadRows(grpc::CallbackServerContext*,
                                                       const grpc::ByteBuffer*) override;
  grpc::Status ReadFile(grpc::ServerContext*, const v1::ReadFileRequest*,
                        grpc::ServerWriter<v1::ReadFileResponse>*) override;
  grpc::Status PutFrame(grpc::ServerContext*, grpc::ServerReader<v1::PutFrameRequest>*,
                        v1::PutFrameResponse*) override;
  grpc::Status DropFrames(grpc::ServerContext*, const v1::DropFramesRequest*,
                          v1::DropFramesResponse*) override;
  grpc::Status SealArchive(grpc::ServerContext*, const v1::SealArchiveRequest*,
                           v1::SealArchiveResponse*) override;
  grpc::Status LocateArchive(grpc::ServerContext*, const v1::LocateArchiveRequest*,
                             v1::LocateArchiveResponse*) override;
  grpc::Status CopyArchive(grpc::ServerContext*, const v1::CopyArchiveRequest*,
                           grpc::ServerWriter<v1::CopyArchiveResponse>*) override;
  grpc::Status DeleteArchive(grpc::ServerContext*, const v1::DeleteArchiveRequest*,
                             v1::DeleteArchiveResponse*) override;
  grpc::Status ListArchives(grpc::ServerContext*, const v1::ListArchivesRequest*,
                            grpc::ServerWriter<v1::ListArchivesResponse>*) override;
  grpc::Status GetSpace(grpc::ServerContext*, const v1::GetSpaceRequest*, v1::GetSpaceResponse*) override;

 private:
  ArchiveStore& store_;
  std::stop_source stopping_;
  JoinedCalls<v1::CreateArchiveResponse> creations_{0};  // by session
  JoinedCalls<v1::ShareFramesResponse> shares_{0};       // by session
  JoinedCalls<v1::SealArchiveResponse> seals_{0};        // by session and plan
  JoinedCalls<v1::DeleteArchiveResponse> deletions_{0};  // by session
};

}  // namespace glasswing
