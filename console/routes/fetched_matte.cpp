#include "console/routes/fetched_matte.h"

#include "console/routes/scratch_file.h"
#include "core/base/checksum.h"
#include "core/base/status.h"
#include "core/file/file.h"
#include "core/service/service.h"

namespace glasswing {
namespace {

absl::Status stream_matte(const ServerLink& server, const Login& login, const v1::FetchMatteRequest& request,
                          absl::FunctionRef<absl::Status(std::string_view)> take) {
  grpc::ClientContext context;
  set_deadline(context, kCallTimeout);
  call_for(login, context);
  const auto stub = v1::SessionService::NewStub(server.channel());
  const auto reader = stub->FetchMatte(&context, request);
  absl::Status taken;
  for (v1::FetchMatteResponse part; taken.ok() && reader->Read(&part);) taken = take(part.chunk());
  if (!taken.ok()) context.TryCancel();
  const grpc::Status finished = reader->Finish();
  GW_RETURN_IF_ERROR(taken);
  return from_grpc(finished, server.title());
}

}  // namespace

absl::StatusOr<FetchedMatte> fetch_matte(const ServerLink& server, const Login& login,
                                         const v1::FetchMatteRequest& request) {
  GW_ASSIGN_OR_RETURN(const ScratchFile scratch, ScratchFile::create());
  GW_ASSIGN_OR_RETURN(FileWriter writer, FileWriter::create(scratch.path()));
  RunningChecksum checksum;
  checksum.start();
  GW_RETURN_IF_ERROR(stream_matte(server, login, request, [&](std::string_view part) {
    checksum.add(part);
    return writer.add(part);
  }));
  GW_ASSIGN_OR_RETURN(std::shared_ptr<const MappedFile> file, scratch.map());
  return FetchedMatte{std::move(file), checksum.text()};
}

}  // namespace glasswing
