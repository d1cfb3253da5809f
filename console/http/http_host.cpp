#include "console/http/http_host.h"

#include <fmt/format.h>
#include <openssl/ssl.h>

#include <nlohmann/json.hpp>

#include "core/base/address.h"
#include "core/base/status.h"
#include "core/security/pem.h"
#include "core/security/tls.h"

namespace glasswing {
namespace {

using httplib::Request;
using httplib::Response;

constexpr size_t kMaxBytes = size_t{1} << 30;  // of a body; each path has a limit of its own

struct FreeContext {
  void operator()(SSL_CTX* context) const { SSL_CTX_free(context); }
};
using TlsContext = std::unique_ptr<SSL_CTX, FreeContext>;

// Uses the certificates current when a browser connects, so renewed ones need no restart.
int use_certificates(SSL* ssl, void*) {
  const TlsMaterial tls = tls_material();
  const std::vector<Certificate> chain = certificates_in(tls.certificate);
  const PrivateKey key = private_key_in(tls.key);
  if (chain.empty() || key == nullptr) return 0;
  if (SSL_use_certificate(ssl, chain.front().get()) != 1 || SSL_use_PrivateKey(ssl, key.get()) != 1) return 0;
  for (size_t i = 1; i < chain.size(); ++i) SSL_add1_chain_cert(ssl, chain[i].get());
  return 1;
}

TlsContext tls_context() {
  TlsContext context(SSL_CTX_new(TLS_server_method()));
  SSL_CTX_set_options(context.get(), SSL_OP_NO_RENEGOTIATION | SSL_OP_NO_COMPRESSION);
  SSL_CTX_set_min_proto_version(context.get(), TLS1_2_VERSION);
  SSL_CTX_set_session_cache_mode(context.get(), SSL_SESS_CACHE_OFF);
  SSL_CTX_set_cert_cb(context.get(), use_certificates, nullptr);
  return context;
}

void answer(Response& response, int status, const std::string& why) {
  response.status = status;
  response.set_content(glasswing::json_of(absl::InvalidArgumentError(why)), "application/json");
}

// True: answered, since the request's body cannot be taken.
bool refuses_body(const Request& request, const HttpHost::BodyLimit& limit, Response& response) {
  if (request.method == "GET" || request.method == "HEAD") return false;
  const std::optional<size_t> max_bytes = request.method == "POST" ? limit(request.path) : std::nullopt;
  const auto size = request.get_header_value<std::uint64_t>("Content-Length");
  if (request.method != "POST") {
    answer(response, 405, fmt::format("the method is {}; it must be GET, HEAD or POST", request.method));
  } else if (!max_bytes) {
    answer(response, 404, fmt::format("{} does not accept POST", request.path));
  } else if (request.has_header("Transfer-Encoding")) {
    answer(response, 411, "the request has Transfer-Encoding; it must use Content-Length instead");
  } else if (request.has_header("Content-Encoding") || request.is_multipart_form_data()) {
    answer(response, 415, "the request's body is compressed or multipart; it must be sent as it is");
  } else if (size > *max_bytes) {
    answer(response, 413, fmt::format("the request's body has more than {} bytes", *max_bytes));
  } else {
    return false;
  }
  return true;
}

}  // namespace

absl::StatusOr<std::unique_ptr<HttpHost>> HttpHost::bind(const std::string& address,
                                                         const HttpLimits& limits) {
  absl::StatusOr<Address> at = parse_address(address);
  if (!at.ok())
    return absl::InvalidArgumentError(fmt::format("--listen is \"{}\"; it must be HOST:PORT", address));
  std::unique_ptr<HttpHost> self(new HttpHost);
  self->has_tls_ = !tls_material().key.empty();
  if (!self->has_tls_ && !is_loopback(address)) {
    return absl::InvalidArgumentError(
        fmt::format("--listen is {}, which other machines reach: it needs TLS; set --ca, --certificate and "
                    "--key, or listen on 127.0.0.1:PORT",
                    address));
  }
  self->server_ = std::make_unique<HttpServer>(limits, self->has_tls_ ? tls_context().release() : nullptr);
  self->server_->set_payload_max_length(kMaxBytes);
  self->server_->set_keep_alive_max_count(1000);
  self->server_->set_tcp_nodelay(true);
  const bool bound = at->port != 0 ? self->server_->bind_to_port(at->host, at->port)
                                   : (at->port = self->server_->bind_to_any_port(at->host)) > 0;
  if (!bound)
    return absl::UnavailableError(
        fmt::format("cannot listen on {} (--listen); is another program running there?", address));
  self->address_ = text_of(*at);
  return self;
}

HttpHost::~HttpHost() {
  stop();
}

void HttpHost::limit_bodies(BodyLimit max_bytes) {
  server_->set_pre_routing_handler(
      [limit = std::move(max_bytes)](const Request& request, Response& response) {
        return refuses_body(request, limit, response) ? httplib::Server::HandlerResponse::Handled
                                                      : httplib::Server::HandlerResponse::Unhandled;
      });
}

void HttpHost::serve() {
  thread_ = std::thread([this] { server_->listen_after_bind(); });
}

void HttpHost::stop() {
  if (!thread_.joinable()) return;
  // The server cannot be stopped before it runs.
  while (!server_->is_running()) std::this_thread::yield();
  server_->stop();
  thread_.join();
}

std::string json_of(const absl::Status& status) {
  return nlohmann::json{{"code", absl::StatusCodeToString(status.code())},
                        {"message", std::string(status.message())}}
      .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

int http_status(const absl::Status& status) {
  switch (status.code()) {
    case absl::StatusCode::kOk:
      return 200;
    case absl::StatusCode::kInvalidArgument:
    case absl::StatusCode::kOutOfRange:
      return 400;
    case absl::StatusCode::kUnauthenticated:
      return 401;
    case absl::StatusCode::kPermissionDenied:
      return 403;
    case absl::StatusCode::kNotFound:
      return 404;
    case absl::StatusCode::kAborted:
    case absl::StatusCode::kAlreadyExists:
    case absl::StatusCode::kFailedPrecondition:
      return 409;
    case absl::StatusCode::kResourceExhausted:
      return 429;
    case absl::StatusCode::kUnimplemented:
      return 501;
    case absl::StatusCode::kUnavailable:
      return 503;
    case absl::StatusCode::kDeadlineExceeded:
      return 504;
    default:
      return 500;
  }
}

void refuse(httplib::Response& response, const absl::Status& status) {
  response.status = http_status(status);
  response.set_content(json_of(status), "application/json");
}

}  // namespace glasswing
