#include "core/security/pem.h"

#include <openssl/err.h>
#include <openssl/pem.h>

namespace glasswing {
namespace {

using Bio = std::unique_ptr<BIO, Free<BIO_free>>;

Bio reader_of(const std::string& text) {
  return Bio(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
}

template <typename Write>
std::string written_by(const Write& write) {
  const Bio out(BIO_new(BIO_s_mem()));
  write(out.get());
  char* bytes = nullptr;
  const long size = BIO_get_mem_data(out.get(), &bytes);
  return std::string(bytes, size);
}

}  // namespace

std::vector<Certificate> certificates_in(const std::string& pem) {
  const Bio in = reader_of(pem);
  std::vector<Certificate> certificates;
  ERR_clear_error();
  while (X509* next = PEM_read_bio_X509(in.get(), nullptr, nullptr, nullptr)) certificates.emplace_back(next);
  const bool at_end = ERR_GET_REASON(ERR_peek_last_error()) == PEM_R_NO_START_LINE;
  ERR_clear_error();
  if (!at_end) certificates.clear();
  return certificates;
}

PrivateKey private_key_in(const std::string& pem) {
  constexpr auto kNoPassphrase = [](char*, int, int, void*) { return -1; };  // rather than ask the terminal
  PrivateKey key(PEM_read_bio_PrivateKey(reader_of(pem).get(), nullptr, +kNoPassphrase, nullptr));
  ERR_clear_error();
  return key;
}

std::string pem_of(const X509& certificate) {
  return written_by([&](BIO* out) { PEM_write_bio_X509(out, &certificate); });
}

std::string pem_of(const EVP_PKEY& key) {
  return written_by(
      [&](BIO* out) { PEM_write_bio_PrivateKey(out, &key, nullptr, nullptr, 0, nullptr, nullptr); });
}

AltNames alt_names_of(const X509& certificate) {
  return AltNames(
      static_cast<GENERAL_NAMES*>(X509_get_ext_d2i(&certificate, NID_subject_alt_name, nullptr, nullptr)));
}

std::string_view text_of(const ASN1_STRING& text) {
  return {reinterpret_cast<const char*>(ASN1_STRING_get0_data(&text)),
          static_cast<size_t>(ASN1_STRING_length(&text))};
}

std::chrono::sys_seconds end_of(const X509& certificate) {
  std::tm end{};
  ASN1_TIME_to_tm(X509_get0_notAfter(&certificate), &end);
  return std::chrono::sys_seconds(std::chrono::seconds(::timegm(&end)));
}

}  // namespace glasswing
