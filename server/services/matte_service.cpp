#include "server/services/matte_service.h"

#include "core/base/status.h"
#include "core/service/message_limits.h"
#include "core/service/service.h"
#include "server/sessions/session_state.h"

namespace glasswing {
namespace {

absl::StatusOr<v1::Session> take(Server& server, const v1::PutMatteRequest& header,
                                 grpc::ServerReader<v1::PutMatteRequest>& reader) {
  GW_ASSIGN_OR_RETURN(ReceivedMatte matte, server.solves().begin_put(header));
  absl::Status kept = matte.add(header.chunk());
  for (v1::PutMatteRequest more; kept.ok() && reader.Read(&more);) kept = matte.add(more.chunk());
  GW_RETURN_IF_ERROR(kept);
  return server.solves().put(header, std::move(matte));
}

}  // namespace

grpc::Status MatteServiceImpl::PutMatte(grpc::ServerContext*, grpc::ServerReader<v1::PutMatteRequest>* reader,
                                        v1::PutMatteResponse* response) {
  v1::PutMatteRequest header;
  if (!reader->Read(&header))
    return to_grpc(absl::InvalidArgumentError("the first message must name the session"));
  GW_CHECK_LIMITS(header);
  absl::StatusOr<v1::Session> session = take(server_, header, *reader);
  if (!session.ok()) return to_grpc(session.status());
  *response->mutable_session() = with_allowed_actions(*std::move(session));
  return grpc::Status::OK;
}

}  // namespace glasswing
