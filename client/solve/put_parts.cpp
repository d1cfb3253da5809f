#include "client/solve/put_parts.h"

#include <algorithm>
#include <iostream>

#include "client/cli/rpc.h"
#include "core/base/checksum.h"
#include "core/base/status.h"
#include "core/cli/progress.h"
#include "core/file/mapped_file.h"
#include "core/file/positioned_file.h"
#include "core/matte/row_part.h"
#include "glasswing/v1/matte_service.grpc.pb.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

constexpr size_t kChunkBytes = 1 << 20;
constexpr std::chrono::minutes kPutTimeout(30);

absl::StatusOr<v1::Session> put(const Client& client, v1::PutMatteRequest header, std::string_view bytes) {
  const Peer<v1::MatteService> server(client.server_title(), client.server);
  header.set_checksum(checksum_of(bytes));
  grpc::ClientContext context;
  set_deadline(context, kPutTimeout);
  v1::PutMatteResponse stored;
  const auto writer = server.stub->PutMatte(&context, &stored);
  bool taken = writer->Write(header);
  v1::PutMatteRequest more;
  for (; taken && !bytes.empty(); bytes.remove_prefix(std::min(kChunkBytes, bytes.size()))) {
    more.set_chunk(bytes.data(), std::min(kChunkBytes, bytes.size()));
    taken = writer->Write(more);
  }
  writer->WritesDone();
  const grpc::Status status = writer->Finish();
  if (!status.ok()) return status_from(status, server.title);
  return std::move(*stored.mutable_session());
}

}  // namespace

absl::StatusOr<v1::Session> put_parts(const Client& client, const std::string& session,
                                      const std::vector<fs::path>& parts, const fs::path& matte,
                                      double seconds) {
  Waiting waiting("joining");
  JoinedParts joined;
  {
    GW_ASSIGN_OR_RETURN(PositionedFile file, PositionedFile::create(matte));
    GW_ASSIGN_OR_RETURN(joined, join_parts(parts, file));
  }
  if (const std::string mixed = mixed_vectors(joined); !mixed.empty())
    waiting.aside([&] { std::cerr << "warning: " << mixed << "\n"; });
  GW_ASSIGN_OR_RETURN(const auto file, MappedFile::open(matte));
  v1::PutMatteRequest header;
  header.set_name(session);
  header.set_archive(joined.origin.archive);
  header.set_computes(joined.origin.computes);
  header.set_seconds(seconds);
  return put(client, std::move(header), file->bytes());
}

}  // namespace glasswing
