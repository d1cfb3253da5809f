#include "server/services/work_service.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/base/status.h"
#include "core/base/time.h"
#include "core/service/message_limits.h"
#include "core/service/service.h"

namespace glasswing {
namespace {

std::string name_of(const v1::TileLease& lease) {
  return fmt::format("{} {} {}", lease.job(), lease.tile(), lease.attempt());
}

absl::Status complete_rows(Server& server, const v1::CompleteTileRequest& header,
                           grpc::ServerReader<v1::CompleteTileRequest>& reader) {
  GW_ASSIGN_OR_RETURN(ReceivedMatte matte, server.tiles().rows_of(header.lease()));
  absl::Status kept = matte.add(header.chunk());
  for (v1::CompleteTileRequest more; kept.ok() && reader.Read(&more);) kept = matte.add(more.chunk());
  return server.tiles().complete(header, std::move(matte));
}

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

absl::Status WorkServiceImpl::check_lease(const grpc::ServerContext& context, const std::string& name,
                                          const v1::TileLease& lease) {
  GW_RETURN_IF_ERROR(check_solver(context, name));
  return seal_.check(name_of(*context.auth_context()), lease);
}

grpc::Status WorkServiceImpl::ClaimTile(grpc::ServerContext* context, const v1::ClaimTileRequest* request,
                                        v1::ClaimTileResponse* response) {
  GW_CHECK_LIMITS(*request);
  if (const absl::Status owned = check_solver(*context, request->solver()); !owned.ok())
    return to_grpc(owned);
  const std::string id =
      request->request_id().empty() ? "" : fmt::format("{} {}", request->solver(), request->request_id());
  while (true) {
    bool joined = true;
    absl::StatusOr<v1::ClaimTileResponse> claimed = claims_.run(*context, id, [&] {
      joined = false;
      return claim(*context, *request);
    });
    // An earlier call's answer is useful only if its tile is still this solver's.
    const bool is_stale =
        joined && claimed.ok() && !(claimed->has_lease() && server_.tiles().renew(claimed->lease()).ok());
    if (!is_stale) return answer(std::move(claimed), *response);
    claims_.forget(id);
  }
}

absl::StatusOr<v1::ClaimTileResponse> WorkServiceImpl::claim(const grpc::ServerContext& context,
                                                             const v1::ClaimTileRequest& request) {
  const nanoseconds until =
      monotonic_now() + std::chrono::milliseconds(std::clamp(request.wait_ms(), 0, 10000));
  while (true) {
    absl::StatusOr<v1::ClaimTileResponse> claimed = server_.tiles().claim(request);
    if (claimed.ok() && claimed->has_lease())
      GW_RETURN_IF_ERROR(seal_.seal(name_of(*context.auth_context()), *claimed->mutable_lease()));
    if (!claimed.ok() || claimed->has_lease() || monotonic_now() >= until || context.IsCancelled())
      return claimed;
    // An expiring lease sends no hint, so ask again every half second.
    server_.tiles().wait_for_tiles(std::chrono::milliseconds(500));
  }
}

grpc::Status WorkServiceImpl::KeepTile(grpc::ServerContext* context, const v1::KeepTileRequest* request,
                                       v1::KeepTileResponse*) {
  GW_CHECK_LIMITS(*request);
  if (const absl::Status own = seal_.check(name_of(*context->auth_context()), request->lease()); !own.ok())
    return to_grpc(own);
  return to_grpc(server_.tiles().renew(request->lease()));
}

grpc::Status WorkServiceImpl::CompleteTile(grpc::ServerContext* context,
                                           grpc::ServerReader<v1::CompleteTileRequest>* reader,
                                           v1::CompleteTileResponse* response) {
  v1::CompleteTileRequest header;
  if (!reader->Read(&header) || !header.has_lease()) {
    return to_grpc(absl::InvalidArgumentError("the first message must name the tile"));
  }
  GW_CHECK_LIMITS(header);
  if (const absl::Status own = check_lease(*context, header.solver(), header.lease()); !own.ok())
    return to_grpc(own);
  const auto complete = [&]() -> absl::StatusOr<v1::CompleteTileResponse> {
    GW_ASSIGN_OR_RETURN(std::optional<FrameMattes> mattes, server_.tiles().frames_of(header.lease()));
    GW_RETURN_IF_ERROR(mattes ? complete_frames(server_, header, *std::move(mattes), *reader)
                              : complete_rows(server_, header, *reader));
    return v1::CompleteTileResponse();
  };
  return answer(results_.run(*context, name_of(header.lease()), complete), *response);
}

grpc::Status WorkServiceImpl::CompleteSurvey(grpc::ServerContext* context,
                                             const v1::CompleteSurveyRequest* request,
                                             v1::CompleteSurveyResponse* response) {
  GW_CHECK_LIMITS(*request);
  if (const absl::Status own = check_lease(*context, request->solver(), request->lease()); !own.ok())
    return to_grpc(own);
  const auto complete = [&]() -> absl::StatusOr<v1::CompleteSurveyResponse> {
    GW_RETURN_IF_ERROR(server_.solves().complete_survey(*request));
    return v1::CompleteSurveyResponse();
  };
  return answer(surveys_.run(*context, name_of(request->lease()), complete), *response);
}

grpc::Status WorkServiceImpl::FailTile(grpc::ServerContext* context, const v1::FailTileRequest* request,
                                       v1::FailTileResponse*) {
  GW_CHECK_LIMITS(*request);
  if (const absl::Status own = check_lease(*context, request->solver(), request->lease()); !own.ok())
    return to_grpc(own);
  return to_grpc(server_.tiles().fail(*request));
}

}  // namespace glasswing
