// Calls to other programs: every call has a deadline, and errors name the peer.
#pragma once

#include <absl/status/statusor.h>
#include <grpcpp/grpcpp.h>

#include <chrono>
#include <memory>
#include <string>

#include "core/service/service.h"

namespace glasswing {

inline constexpr std::chrono::seconds kCallTimeout(10);
// For calls in which the server calls nodes, or that transfer one file.
inline constexpr std::chrono::seconds kLongCallTimeout(60);

template <typename Service>
struct Peer {
  Peer(std::string title_in, const std::string& address)
      : title(std::move(title_in)), stub(Service::NewStub(dial(address))) {}

  std::string title;  // "server at 127.0.0.1:7440"
  std::unique_ptr<typename Service::Stub> stub;
};

// Like from_grpc(status, peer), but keeps the server's own message about a node that does not answer.
inline absl::Status status_from(const grpc::Status& status, const std::string& peer) {
  const bool about_a_node = status.error_message().find("node") != std::string::npos;
  return about_a_node ? from_grpc(status) : from_grpc(status, peer);
}

template <typename Service, typename Stub, typename Request, typename Response>
absl::StatusOr<Response> call(const Peer<Service>& peer,
                              grpc::Status (Stub::*rpc)(grpc::ClientContext*, const Request&, Response*),
                              const std::type_identity_t<Request>& request,
                              std::chrono::milliseconds timeout = kCallTimeout) {
  grpc::ClientContext context;
  set_deadline(context, timeout);
  Response response;
  const grpc::Status status = ((*peer.stub).*rpc)(&context, request, &response);
  if (!status.ok()) return status_from(status, peer.title);
  return response;
}

// The same for a list: all its pages (https://google.aip.dev/158) in one answer.
template <typename Service, typename Stub, typename Request, typename Response>
absl::StatusOr<Response> call_pages(
    const Peer<Service>& peer, grpc::Status (Stub::*rpc)(grpc::ClientContext*, const Request&, Response*),
    std::type_identity_t<Request> request, std::chrono::milliseconds timeout = kCallTimeout) {
  Response all;
  do {
    const absl::StatusOr<Response> page = call(peer, rpc, request, timeout);
    if (!page.ok()) return page.status();
    request.set_page_token(page->next_page_token());
    all.MergeFrom(*page);
  } while (!request.page_token().empty());
  all.clear_next_page_token();
  return all;
}

}  // namespace glasswing
