// Owning pointers to OpenSSL's objects, and certificates and keys in PEM.
#pragma once

#include <openssl/bio.h>
#include <openssl/evp.h>
#include <openssl/x509v3.h>

#include <chrono>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace glasswing {

template <auto kFree>
struct Free {
  void operator()(auto* object) const { kFree(object); }
};
using Certificate = std::unique_ptr<X509, Free<X509_free>>;
using PrivateKey = std::unique_ptr<EVP_PKEY, Free<EVP_PKEY_free>>;

// All certificates of the text, in order. Empty: there is none, or one is malformed.
std::vector<Certificate> certificates_in(const std::string& pem);
// Null: there is no key, or it needs a passphrase.
PrivateKey private_key_in(const std::string& pem);

std::string pem_of(const X509& certificate);
std::string pem_of(const EVP_PKEY& key);  // without a passphrase

// A certificate's subject alternative names: hosts, addresses, URIs. Null: it has none.
using AltNames = std::unique_ptr<GENERAL_NAMES, Free<GENERAL_NAMES_free>>;
AltNames alt_names_of(const X509& certificate);
// A view of its bytes, valid as long as `text`.
std::string_view text_of(const ASN1_STRING& text);

// The end of its validity.
std::chrono::sys_seconds end_of(const X509& certificate);

}  // namespace glasswing
