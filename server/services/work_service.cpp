#include "server/services/work_service.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/base/status.h"
#include "core/base/time.h"
#include "core/service/message_limits.h"
#include "core/service/service.h"

namespace glasswing {
namespace {

constexpr size_t kMaxTileBytes = 256u << 20;

absl::Status complete_frames(Server& server, const v1::CompleteTileRequest& header, FrameMattes mattes,
                             grpc::ServerReader<v1::CompleteTileRequest>& reader) {
  int frame = -1;
  for (v1::CompleteTileRequest request; reader.Read(&request);) {
    if (request.has_frame() && request.frame() != frame) {
      frame = request.frame();
      GW_RETURN_IF_ERROR(mattes.begin(frame, request.checksum()));
    }
    GW_RETURN_IF_ERROR(mattes.add(request.chunk()));
  }
  return server.tiles().complete(header, std::move(mattes));
}

}  // namespace

absl::Status WorkServiceImpl::check_solver(const grpc::ServerContext& context,
                                           const std::string& name) const {
  return server_.rig().check_owner(name, peer_of(*context.auth_context()));
}

grpc::Status WorkServiceImpl::ClaimTile(grpc::ServerContext* context, const v1::ClaimTileRequest* request,
                                        v1::ClaimTileResponse* response) {
  GW_CHECK_LIMITS(*request);
  if (const absl::Status owned = check_solver(*context, request->solver()); !owned.ok())
    return to_grpc(owned);
  const nanoseconds until =
      monotonic_now() + std::chrono::milliseconds(std::clamp(request->wait_ms(), 0, 10000));
  while (true) {
    absl::StatusOr<v1::ClaimTileResponse> claimed = server_.tiles().claim(*request);
    if (!claimed.ok()) return to_grpc(claimed.status());
    if (claimed->has_lease() || monotonic_now() >= until || context->IsCancelled()) {
      *response = *std::move(claimed);
      return grpc::Status::OK;
    }
    // An expiring lease gives no hint, so ask again every half second.
    server_.tiles().wait_for_tiles(std::chrono::milliseconds(500));
  }
}

grpc::Status WorkServiceImpl::KeepTile(grpc::ServerContext*, const v1::KeepTileRequest* request,
                                       v1::KeepTileResponse*) {
  GW_CHECK_LIMITS(*request);
  return to_grpc(server_.tiles().renew(request->lease()));
}

grpc::Status WorkServiceImpl::CompleteTile(grpc::ServerContext* context,
                                           grpc::ServerReader<v1::CompleteTileRequest>* reader,
                                           v1::CompleteTileResponse*) {
  v1::CompleteTileRequest header;
  if (!reader->Read(&header) || !header.has_lease()) {
    return to_grpc(absl::InvalidArgumentError("the first message must name the tile"));
  }
  GW_CHECK_LIMITS(header);
  if (const absl::Status owned = check_solver(*context, header.solver()); !owned.ok()) return to_grpc(owned);
  absl::StatusOr<std::optional<FrameMattes>> mattes = server_.tiles().frames_of(header.lease());
  if (!mattes.ok()) return to_grpc(mattes.status());
  if (*mattes) return to_grpc(complete_frames(server_, header, **std::move(mattes), *reader));
  std::string matte = header.chunk();
  v1::CompleteTileRequest more;
  while (reader->Read(&more)) {
    matte += more.chunk();
    if (matte.size() > kMaxTileBytes) {
      return to_grpc(
          absl::InvalidArgumentError(fmt::format("the tile is larger than {} bytes", kMaxTileBytes)));
    }
  }
  return to_grpc(server_.tiles().complete(header, matte));
}

grpc::Status WorkServiceImpl::CompleteSurvey(grpc::ServerContext*, const v1::CompleteSurveyRequest* request,
                                             v1::CompleteSurveyResponse*) {
  GW_CHECK_LIMITS(*request);
  return to_grpc(server_.solves().complete_survey(*request));
}

grpc::Status WorkServiceImpl::FailTile(grpc::ServerContext* context, const v1::FailTileRequest* request,
                                       v1::FailTileResponse*) {
  GW_CHECK_LIMITS(*request);
  if (const absl::Status owned = check_solver(*context, request->solver()); !owned.ok())
    return to_grpc(owned);
  return to_grpc(server_.tiles().fail(*request));
}

}  // namespace glasswing
