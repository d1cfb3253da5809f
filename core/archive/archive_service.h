// ArchiveService over an ArchiveStore.
#pragma once

#include "core/archive/archive_store.h"
#include "glasswing/v1/archive_service.grpc.pb.h"

namespace glasswing {

class ArchiveServiceImpl final : public v1::ArchiveService::Service {
 public:
  explicit ArchiveServiceImpl(ArchiveStore& store) : store_(store) {}
  grpc::Status CreateArchive(grpc::ServerContext*, const v1::CreateArchiveRequest*,
                             v1::CreateArchiveResponse*) override;
  grpc::Status GetManifest(grpc::ServerContext*, const v1::GetManifestRequest*,
                           v1::GetManifestResponse*) override;
  grpc::Status ReadRows(grpc::ServerContext*, const v1::ReadRowsRequest*,
                        grpc::ServerWriter<v1::ReadRowsResponse>*) override;
  grpc::Status ReadFile(grpc::ServerContext*, const v1::ReadFileRequest*,
                        grpc::ServerWriter<v1::ReadFileResponse>*) override;
  grpc::Status PutFrame(grpc::ServerContext*, grpc::ServerReader<v1::PutFrameRequest>*,
                        v1::PutFrameResponse*) override;
  grpc::Status SealArchive(grpc::ServerContext*, const v1::SealArchiveRequest*,
                           v1::SealArchiveResponse*) override;
  grpc::Status DeleteArchive(grpc::ServerContext*, const v1::DeleteArchiveRequest*,
                             v1::DeleteArchiveResponse*) override;
  grpc::Status GetSpace(grpc::ServerContext*, const v1::GetSpaceRequest*, v1::GetSpaceResponse*) override;

 private:
  ArchiveStore& store_;
};

}  // namespace glasswing
