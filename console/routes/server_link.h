// The console's calls to the server: about logins under its own certificate, and for people with their
// logins.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <grpcpp/grpcpp.h>

#include <chrono>
#include <memory>
#include <string>

#include "core/security/login.h"
#include "glasswing/v1/session.pb.h"

namespace glasswing {

inline constexpr std::chrono::seconds kCallTimeout(60);  // of a browser's call, to the server or a node

// Waits until a channel is connected: after a failure gRPC goes on with that only while somebody waits.
void wait_for(grpc::Channel& channel, std::chrono::milliseconds time);

// Makes the server check the call by the person's role, and log it under the person's name.
void call_for(const Login& login, grpc::ClientContext& context);

// Thread-safe. UNAVAILABLE, from all methods: the server does not answer.
class ServerLink {
 public:
  // `address` is HOST:PORT.
  explicit ServerLink(const std::string& address);

  // For calls with call_for().
  const std::shared_ptr<grpc::Channel>& channel() const { return channel_; }
  // "the server at 127.0.0.1:7440", for messages.
  const std::string& title() const { return title_; }

  // UNAUTHENTICATED: not a token that is valid. `from`: the browser's address. `locked_out`: LogInRequest's.
  absl::StatusOr<Login> log_in(const std::string& token, const std::string& from, bool locked_out) const;
  absl::Status log_out(const Login& login) const;
  // UNAUTHENTICATED: the login has ended.
  absl::StatusOr<Principal> principal_of(const std::string& login) const;
  // As the login's owner sees it. NOT_FOUND: there is no such session.
  absl::StatusOr<v1::Session> session(const Login& login, const std::string& name) const;
  // Says where browsers find the console. Waits a while for a lost connection.
  absl::Status announce(const std::string& url) const;

 private:
  const std::string title_;
  const std::shared_ptr<grpc::Channel> channel_;
};

}  // namespace glasswing
