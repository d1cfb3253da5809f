#include "client/cli/caller_metadata.h"

#include <grpcpp/grpcpp.h>
#include <pwd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <string>

namespace glasswing {
namespace {

// Metadata is printable ASCII.
std::string ascii(std::string text) {
  std::ranges::replace_if(
      text, [](char c) { return c < ' ' || c > '~'; }, '?');
  return text;
}

std::string user_at_host() {
  const passwd* const user = ::getpwuid(::geteuid());
  std::array<char, 256> host{};
  if (::gethostname(host.data(), host.size() - 1) != 0) host = {"?"};
  return ascii(std::string(user == nullptr ? std::to_string(::geteuid()) : user->pw_name) + "@" +
               host.data());
}

class CallerMetadata final : public grpc::ClientContext::GlobalCallbacks {
 public:
  void DefaultConstructor(grpc::ClientContext* context) override {
    context->AddMetadata("glasswing-client", client_);
    const char* const hold = std::getenv(kHoldVariable);
    if (hold != nullptr && *hold != '\0') context->AddMetadata("glasswing-hold", ascii(hold));
  }
  void Destructor(grpc::ClientContext*) override {}

 private:
  const std::string client_ = user_at_host();
};

}  // namespace

void send_caller_metadata() {
  // gRPC keeps the pointer forever and accepts only one.
  [[maybe_unused]] static const bool once = [] {
    grpc::ClientContext::SetGlobalCallbacks(new CallerMetadata);
    return true;
  }();
}

}  // namespace glasswing
