#include "server/console/http_host.h"

#include <fmt/format.h>
#include <openssl/ssl.h>

#include <charconv>

#include "core/base/status.h"
#include "core/security/pem.h"
#include "core/security/tls.h"
#include "server/console/json_call.h"

namespace glasswing {
namespace {

// Concurrent requests: a page has up to six connections, and each stream occupies one.
constexpr size_t kThreads = 64;
constexpr size_t kMaxBytes = size_t{64} << 20;  // of a request; larger ones are read, dropped and refused
constexpr time_t kKeepAlive_s = 15, kRead_s = 10, kWrite_s = 30;

// Uses the certificates current when a browser connects, so renewed ones need no restart.
int use_certificates(SSL* ssl, void*) {
  const TlsMaterial tls = tls_material();
  const std::vector<Certificate> chain = certificates_in(tls.certificate),
                                 authorities = certificates_in(tls.ca);
  const PrivateKey key = private_key_in(tls.key);
  if (chain.empty() || key == nullptr) return 0;
  if (SSL_use_certificate(ssl, chain.front().get()) != 1 || SSL_use_PrivateKey(ssl, key.get()) != 1) return 0;
  for (size_t i = 1; i < chain.size(); ++i) SSL_add1_chain_cert(ssl, chain[i].get());
  X509_STORE* store = X509_STORE_new();
  for (const Certificate& authority : authorities) {
    X509_STORE_add_cert(store, authority.get());
    SSL_add_client_CA(ssl, authority.get());  // so that browsers offer matching certificates
  }
  return static_cast<int>(SSL_set0_verify_cert_store(ssl, store));
}

// A client certificate is optional, but must be of our CA; clients without one log in by a token.
bool set_up(SSL_CTX& context) {
  SSL_CTX_set_min_proto_version(&context, TLS1_2_VERSION);
  SSL_CTX_set_verify(&context, SSL_VERIFY_PEER, nullptr);
  SSL_CTX_set_session_cache_mode(&context, SSL_SESS_CACHE_OFF);
  SSL_CTX_set_cert_cb(&context, use_certificates, nullptr);
  return true;
}

void set_limits(httplib::Server& server) {
  server.new_task_queue = [] { return new httplib::ThreadPool(kThreads); };
  server.set_payload_max_length(kMaxBytes);
  server.set_keep_alive_timeout(kKeepAlive_s);
  server.set_keep_alive_max_count(1000);
  server.set_read_timeout(kRead_s);
  server.set_write_timeout(kWrite_s);
  server.set_tcp_nodelay(true);
}

}  // namespace

absl::StatusOr<std::unique_ptr<HttpHost>> HttpHost::bind(const std::string& address) {
  const size_t colon = address.rfind(':');
  int port = -1;
  if (colon != std::string::npos)
    std::from_chars(address.data() + colon + 1, address.data() + address.size(), port);
  if (port < 0 || port > 65535)
    return absl::InvalidArgumentError(fmt::format("--console is \"{}\"; it must be HOST:PORT", address));
  std::unique_ptr<HttpHost> self(new HttpHost);
  self->has_tls_ = !tls_material().key.empty();
  if (!self->has_tls_ && !is_loopback(address)) {
    return absl::InvalidArgumentError(
        fmt::format("--console is {}, which other machines reach: it needs TLS; set --ca, --certificate and "
                    "--key, or let it be 127.0.0.1:PORT",
                    address));
  }
  if (self->has_tls_) {
    self->server_ = std::make_unique<httplib::SSLServer>(set_up);
  } else {
    self->server_ = std::make_unique<httplib::Server>();
  }
  set_limits(*self->server_);
  std::string host = address.substr(0, colon);
  if (host.size() > 2 && host.front() == '[') host = host.substr(1, host.size() - 2);
  const bool bound = port != 0 ? self->server_->bind_to_port(host, port)
                               : (port = self->server_->bind_to_any_port(host)) > 0;
  if (!bound) return absl::UnavailableError(fmt::format("--console {} cannot be listened on", address));
  self->address_ = fmt::format("{}:{}", address.substr(0, colon), port);
  return self;
}

HttpHost::~HttpHost() {
  stop();
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

void refuse(httplib::Response& response, const absl::Status& status) {
  response.status = http_status(status);
  response.set_content(json_of(status), "application/json");
}

}  // namespace glasswing
