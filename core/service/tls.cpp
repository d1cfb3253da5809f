#include "core/service/tls.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <openssl/pem.h>
#include <openssl/x509.h>

#include "core/base/file.h"
#include "core/base/status.h"
#include "core/service/roles.h"

namespace glasswing {
namespace {

struct Tls {
  TlsFiles files = {};
  std::shared_ptr<grpc::ChannelCredentials> calling = nullptr;   // null: no TLS
  std::shared_ptr<grpc::ServerCredentials> listening = nullptr;  // likewise
  absl::Status problem = {};                                     // with the files
};

Tls& in_force() {
  static Tls tls;
  return tls;
}

template <auto kFree>
struct Free {
  void operator()(auto* object) const { kFree(object); }
};
using Certificate = std::unique_ptr<X509, Free<X509_free>>;
using PrivateKey = std::unique_ptr<EVP_PKEY, Free<EVP_PKEY_free>>;
using Memory = std::unique_ptr<BIO, Free<BIO_free>>;

Memory memory_of(const std::string& text) {
  return Memory(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
}

absl::StatusOr<std::string> read_pem(const char* what, const std::string& path) {
  absl::StatusOr<std::string> pem = read_file(path);
  if (pem.ok()) return pem;
  return absl::InvalidArgumentError(
      fmt::format("the {} cannot be read: {}", what, std::string(pem.status().message())));
}

absl::StatusOr<Certificate> certificate_of(const char* what, const std::string& path,
                                           const std::string& pem) {
  Certificate certificate(PEM_read_bio_X509(memory_of(pem).get(), nullptr, nullptr, nullptr));
  if (certificate == nullptr) {
    return absl::InvalidArgumentError(
        fmt::format("the {} is {}; it must be a certificate in PEM", what, path));
  }
  if (X509_cmp_current_time(X509_get0_notAfter(certificate.get())) < 0)
    return absl::InvalidArgumentError(fmt::format("the {} {} has expired", what, path));
  return certificate;
}

absl::Status check_pair(const TlsFiles& files, const std::string& certificate_pem,
                        const std::string& key_pem) {
  GW_ASSIGN_OR_RETURN(const Certificate certificate,
                      certificate_of("certificate", files.certificate, certificate_pem));
  constexpr auto kNoPassphrase = [](char*, int, int, void*) { return -1; };  // rather than ask the terminal
  const PrivateKey key(PEM_read_bio_PrivateKey(memory_of(key_pem).get(), nullptr, +kNoPassphrase, nullptr));
  if (key == nullptr) {
    return absl::InvalidArgumentError(
        fmt::format("the key is {}; it must be a private key in PEM, without a passphrase", files.key));
  }
  if (X509_check_private_key(certificate.get(), key.get()) == 1) return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("the key {} does not belong to the certificate {}", files.key, files.certificate));
}

// Null without a CA.
absl::StatusOr<Tls> credentials_of(const TlsFiles& files) {
  if (files.certificate.empty() != files.key.empty()) {
    return absl::InvalidArgumentError(
        files.key.empty() ? fmt::format("the certificate {} lacks its key; set --key", files.certificate)
                          : fmt::format("the key {} lacks its certificate; set --certificate", files.key));
  }
  Tls tls{.files = files};
  if (files.ca.empty()) {
    if (files.certificate.empty()) return tls;
    return absl::InvalidArgumentError(fmt::format(
        "the certificate {} lacks the CA that signs those of the peers; set --ca", files.certificate));
  }
  grpc::SslCredentialsOptions calling;
  GW_ASSIGN_OR_RETURN(calling.pem_root_certs, read_pem("CA", files.ca));
  GW_RETURN_IF_ERROR(certificate_of("CA", files.ca, calling.pem_root_certs).status());
  if (!files.certificate.empty()) {
    GW_ASSIGN_OR_RETURN(calling.pem_cert_chain, read_pem("certificate", files.certificate));
    GW_ASSIGN_OR_RETURN(calling.pem_private_key, read_pem("key", files.key));
    GW_RETURN_IF_ERROR(check_pair(files, calling.pem_cert_chain, calling.pem_private_key));
    grpc::SslServerCredentialsOptions listening(GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY);
    listening.pem_root_certs = calling.pem_root_certs;
    listening.pem_key_cert_pairs.push_back({calling.pem_private_key, calling.pem_cert_chain});
    tls.listening = grpc::SslServerCredentials(listening);
    tls.listening->SetAuthMetadataProcessor(role_gate());
  }
  tls.calling = grpc::SslCredentials(calling);
  return tls;
}

bool contains(const std::string& text, const char* words) {
  return text.find(words) != std::string::npos;
}

}  // namespace

absl::Status use_tls(const TlsFiles& files) {
  const absl::StatusOr<Tls> tls = credentials_of(files);
  in_force() = tls.ok() ? *tls : Tls{.files = files, .problem = tls.status()};
  return tls.status();
}

bool is_loopback(const std::string& address) {
  std::string host = address.substr(0, address.rfind(':'));
  if (host.size() > 2 && host.front() == '[') host = host.substr(1, host.size() - 2);
  in_addr ip{};
  if (::inet_pton(AF_INET, host.c_str(), &ip) == 1) return ntohl(ip.s_addr) >> 24 == 127;
  return host == "localhost" || host == "::1";
}

std::shared_ptr<grpc::ChannelCredentials> credentials_for(const std::string& address) {
  if (in_force().calling != nullptr) return in_force().calling;
  return is_loopback(address) && in_force().problem.ok() ? grpc::InsecureChannelCredentials() : nullptr;
}

absl::StatusOr<std::shared_ptr<grpc::ServerCredentials>> listening_credentials(const std::string& address) {
  GW_RETURN_IF_ERROR(in_force().problem);
  if (in_force().listening != nullptr) return in_force().listening;
  if (is_loopback(address)) return grpc::InsecureServerCredentials();
  return absl::InvalidArgumentError(
      fmt::format("--listen is {}, which other machines reach: they need TLS; set --ca, --certificate and "
                  "--key, or listen on "
                  "127.0.0.1:PORT",
                  address));
}

std::string tls_failure(const grpc::Status& status, const std::string& peer) {
  const std::string& words = status.error_message();
  const TlsFiles& files = in_force().files;
  if (status.error_code() == grpc::StatusCode::INVALID_ARGUMENT && words == "Invalid credentials.") {
    if (!in_force().problem.ok()) return std::string(in_force().problem.message());
    return peer + " is beyond this machine, where calls need TLS; set --ca, and --certificate and --key";
  }
  if (status.error_code() != grpc::StatusCode::UNAVAILABLE || !contains(words, "failed to connect"))
    return "";
  if (files.ca.empty()) {
    if (!contains(words, "Socket closed")) return "";  // which is how a TLS server ends it
    return peer + " does not answer in the clear; if it speaks TLS, set --ca, --certificate and --key";
  }
  if (contains(words, "certificate verify failed")) {
    return fmt::format("{} shows a certificate that the CA {} did not sign, or that has expired", peer,
                       files.ca);
  }
  if (contains(words, "is not in peer certificate"))
    return peer + " shows a certificate of another host; call it by a name that its certificate has";
  if (contains(words, "wrong version number"))
    return peer + " does not speak TLS; if it need not, call it without a CA";
  if (!contains(words, "Socket closed")) return "";
  // How a handshake ends for gRPC when the other side refuses us.
  return files.certificate.empty()
             ? peer + " wants to know who calls; set --certificate and --key"
             : fmt::format("{} refuses the certificate {}; its own CA must have signed it", peer,
                           files.certificate);
}

}  // namespace glasswing
