// OpenSSL's objects with an owner, and certificates and keys in PEM.
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

// All of the text, in order. Empty: there is none, or one of them is broken.
std::vector<Certificate> certificates_in(const std::string& pem);
// Null: there is none, or it needs a passphrase.
PrivateKey private_key_in(const std::string& pem);

std::string pem_of(const X509& certificate);
std::string pem_of(const EVP_PKEY& key);  // without a passphrase

// A certificate's other names: hosts, addresses, URIs. Null: it has none.
using AltNames = std::unique_ptr<GENERAL_NAMES, Free<GENERAL_NAMES_free>>;
AltNames alt_names_of(const X509& certificate);
// Its bytes, which live as long as `text`.
std::string_view text_of(const ASN1_STRING& text);

// The last moment of the time in which it is valid.
std::chrono::sys_seconds end_of(const X509& certificate);

}  // namespace glasswing
