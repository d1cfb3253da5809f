#include "client/sessions/matte_input.h"

#include <fmt/format.h>

#include "core/base/status.h"
#include "core/cli/output.h"
#include "core/cli/output_file.h"
#include "core/matte/matte_file.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
constexpr std::chrono::minutes kFetchTimeout(10);

}  // namespace

absl::Status stream_matte(const Peer<v1::SessionService>& server, const v1::FetchMatteRequest& request,
                          FileWriter& writer, Waiting* waiting) {
  grpc::ClientContext context;
  set_deadline(context, kFetchTimeout);
  const auto reader = server.stub->FetchMatte(&context, request);
  absl::Status written;
  double bytes = 0.0;
  for (v1::FetchMatteResponse response; written.ok() && reader->Read(&response);) {
    written = writer.add(response.chunk());
    bytes += static_cast<double>(response.chunk().size());
    if (waiting != nullptr) waiting->tell(bytes_text(bytes));
  }
  if (!written.ok()) context.TryCancel();
  const grpc::Status status = reader->Finish();
  GW_RETURN_IF_ERROR(written);
  return status.ok() ? absl::OkStatus() : status_from(status, server.title);
}

absl::StatusOr<std::shared_ptr<const MappedFile>> MatteInput::open(const Client& client,
                                                                   const fs::path& output) const {
  if (is_file()) return MappedFile::open(name);
  Waiting waiting("fetching " + name);
  const Peer<v1::SessionService> server(client.server_title(), client.server);
  const UnfinishedFile file(output);  // never finished
  v1::FetchMatteRequest request;
  request.set_name(name);
  GW_ASSIGN_OR_RETURN(FileWriter writer, FileWriter::create(file.path()));
  GW_RETURN_IF_ERROR(stream_matte(server, request, writer, &waiting));
  return MappedFile::open(file.path());
}

absl::Status MatteInput::error(const absl::Status& status) const {
  return absl::Status(status.code(), fmt::format("{}{}: {}", is_file() ? "" : "the matte of session ", name,
                                                 std::string(status.message())));
}

absl::StatusOr<Matte> read_matte_input(const Client& client, const std::string& name, const fs::path& output,
                                       Pyramids pyramids) {
  const MatteInput input{name};
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<const MappedFile> file, input.open(client, output));
  absl::StatusOr<Matte> matte = decode_matte(file->bytes(), pyramids);
  if (!matte.ok()) return input.error(matte.status());
  return matte;
}

}  // namespace glasswing
