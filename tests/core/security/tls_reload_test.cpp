#include "core/security/tls_reload.h"

#include <gtest/gtest.h>
#include <spdlog/sinks/ringbuffer_sink.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <filesystem>
#include <future>

#include "core/file/file.h"
#include "core/security/tls.h"
#include "core/service/service.h"
#include "glasswing/v1/session_service.grpc.pb.h"
#include "tests/core/security/made_certificates.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

using namespace std::chrono_literals;

const std::string kNames = "IP:127.0.0.1,URI:urn:glasswing:role:operator,URI:urn:glasswing:role:server";

// Reports its caller; a watcher gets two messages, the second one when the test says so.
class Greeter final : public v1::SessionService::Service {
 public:
  grpc::Status PauseSession(grpc::ServerContext* context, const v1::PauseSessionRequest*,
                            v1::PauseSessionResponse* response) override {
    const auto names = context->auth_context()->FindPropertyValues(GRPC_X509_CN_PROPERTY_NAME);
    response->mutable_session()->set_name(std::string(names.front().data(), names.front().size()));
    return grpc::Status::OK;
  }
  grpc::Status WatchSession(grpc::ServerContext*, const v1::WatchSessionRequest*,
                            grpc::ServerWriter<v1::WatchSessionResponse>* stream) override {
    stream->Write({});
    go_on.get_future().wait();
    stream->Write({});
    return grpc::Status::OK;
  }

  std::promise<void> go_on;
};

// The caller as the server saw it, and the server that answered.
struct Meeting {
  grpc::Status status;
  std::string caller, host;
};

Meeting meet(const std::shared_ptr<grpc::Channel>& channel) {
  const auto stub = v1::SessionService::NewStub(channel);
  grpc::ClientContext context;
  set_deadline(context, 10s);
  v1::PauseSessionResponse answer;
  Meeting meeting{stub->PauseSession(&context, {}, &answer), answer.session().name(), ""};
  if (!meeting.status.ok()) return meeting;
  const auto names = context.auth_context()->FindPropertyValues(GRPC_X509_CN_PROPERTY_NAME);
  if (!names.empty()) meeting.host = std::string(names.front().data(), names.front().size());
  return meeting;
}

template <typename Condition>
bool until(const Condition& holds) {
  for (const auto deadline = std::chrono::steady_clock::now() + 20s;
       std::chrono::steady_clock::now() < deadline; std::this_thread::sleep_for(20ms)) {
    if (holds()) return true;
  }
  return false;
}

// A host and its callers in one process, with a certificate in the files rig.pem and rig.key.
class TlsReloading : public testing::Test {
 protected:
  TlsReloading() { spdlog::set_default_logger(std::make_shared<spdlog::logger>("test", log_)); }
  ~TlsReloading() override {
    host_.reset();
    (void)use_tls({});  // ends the reload thread, which logs
    spdlog::drop_all();
  }

  std::string file(const std::string& name) const { return (scratch_ / name).string(); }
  void write(const std::string& name, const std::string& text) const {
    ASSERT_OK(write_file_durably(file(name), text));
  }
  void install(const MadeCertificate& own) const {
    write("rig.key", own.key_pem());
    write("rig.pem", own.certificate_pem());
  }
  void start(const std::string& authorities, const MadeCertificate& own) {
    write("ca.pem", authorities);
    install(own);
    ASSERT_OK(use_tls({file("ca.pem"), file("rig.pem"), file("rig.key")}));
    host_ = ServiceHost::start({}, {&greeter_}).value();
  }
  // On a new connection of this process.
  Meeting met() const { return meet(dial(host_->address())); }
  // By a caller whose files never change.
  Meeting met_by(const MadeCertificate& own, const MadeCertificate& trusted) const {
    return meet(grpc::CreateChannel(
        host_->address(),
        grpc::SslCredentials({trusted.certificate_pem(), own.key_pem(), own.certificate_pem()})));
  }
  bool until_both_are(const std::string& name) const {
    return until([&] {
      const Meeting meeting = met();
      return meeting.host == name && meeting.caller == name;
    });
  }
  // Restarts the host, so that all callers have to connect again.
  void restart_host() {
    const std::string address = host_->address();
    host_.reset();
    host_ = ServiceHost::start({.address = address}, {&greeter_}).value();
  }
  int lines_with(const std::string& words) const {  // of the log
    return static_cast<int>(std::ranges::count_if(
        log_->last_formatted(), [&](const std::string& line) { return line.find(words) != line.npos; }));
  }

  const TemporaryDirectory scratch_;
  const MadeCertificate ca_ = make_certificate("ca");
  const std::shared_ptr<spdlog::sinks::ringbuffer_sink_mt> log_ =
      std::make_shared<spdlog::sinks::ringbuffer_sink_mt>(100);
  Greeter greeter_;
  std::unique_ptr<ServiceHost> host_;
};

TEST_F(TlsReloading, NewConnectionsUseTheNewCertificateAndRunningCallsGoOn) {
  start(ca_.certificate_pem(), make_certificate("first", &ca_, kNames));
  const auto lasting = dial(host_->address());
  EXPECT_EQ(meet(lasting).caller, "first");
  const auto stub = v1::SessionService::NewStub(lasting);
  grpc::ClientContext context;
  set_deadline(context, 40s);
  const auto stream = stub->WatchSession(&context, {});
  v1::WatchSessionResponse message;
  ASSERT_TRUE(stream->Read(&message));

  install(make_certificate("second", &ca_, kNames));
  EXPECT_TRUE(until_both_are("second"));
  greeter_.go_on.set_value();
  EXPECT_TRUE(stream->Read(&message));
  EXPECT_FALSE(stream->Read(&message));
  EXPECT_OK(stream->Finish());
  EXPECT_EQ(meet(lasting).caller, "first") << "its connection lasts";

  restart_host();
  Meeting again;
  EXPECT_TRUE(until([&] { return (again = meet(lasting)).status.ok(); })) << again.status.error_message();
  EXPECT_EQ(again.caller, "second");
  EXPECT_EQ(again.host, "second");
  EXPECT_EQ(lines_with("certificates taken up"), 1);
}

// First all trust both CAs, then all change certificates, then the old CA is dropped.
TEST_F(TlsReloading, AnotherAuthorityIsTakenUpWithoutAGap) {
  const MadeCertificate other_ca = make_certificate("other ca");
  const MadeCertificate old_caller = make_certificate("old", &ca_, kNames);
  const MadeCertificate new_caller = make_certificate("new", &other_ca, kNames);
  start(ca_.certificate_pem(), make_certificate("first", &ca_, kNames));
  const auto lasting = dial(host_->address());
  EXPECT_OK(meet(lasting).status);
  EXPECT_OK(met_by(old_caller, ca_).status);
  EXPECT_FALSE(met_by(new_caller, ca_).status.ok());

  write("ca.pem", ca_.certificate_pem() + other_ca.certificate_pem());
  EXPECT_TRUE(until([&] { return met_by(new_caller, ca_).status.ok(); }));
  EXPECT_OK(met_by(old_caller, ca_).status);

  install(make_certificate("second", &other_ca, kNames));
  EXPECT_TRUE(until_both_are("second"));
  EXPECT_OK(met_by(old_caller, other_ca).status);
  restart_host();
  EXPECT_TRUE(until([&] { return meet(lasting).caller == "second"; }));

  write("ca.pem", other_ca.certificate_pem());
  EXPECT_TRUE(until([&] { return !met_by(old_caller, other_ca).status.ok(); }));
  EXPECT_OK(met_by(new_caller, other_ca).status);
  EXPECT_EQ(met().host, "second");
}

TEST_F(TlsReloading, WhatIsHalfReplacedOrBrokenChangesNothingAndIsToldOnce) {
  start(ca_.certificate_pem(), make_certificate("first", &ca_, kNames));
  const MadeCertificate next = make_certificate("second", &ca_, kNames);
  const MadeCertificate expired = make_certificate("expired", &ca_, kNames, 0);
  // After two reads the previous problem has been logged, and the files read again.
  const auto told = [&](const std::string& words) {
    EXPECT_TRUE(until([&] { return lines_with(words) > 0; })) << words;
    EXPECT_EQ(met().host, "first") << words;
    EXPECT_EQ(met().caller, "first") << words;
  };
  write("rig.key", next.key_pem());
  told("does not belong to the certificate");
  write("rig.pem", "-----BEGIN CERTIFICATE-----\nMIIB");
  told("it must be a certificate in PEM");
  std::filesystem::remove(file("rig.pem"));
  told("the certificate cannot be read");
  install(expired);
  told("has expired");
  install(make_certificate("third", &ca_, kNames));
  EXPECT_TRUE(until_both_are("third"));
  EXPECT_EQ(lines_with("certificates stay as they were"), 4);
}

TEST_F(TlsReloading, OneThatExpiredIsPutRightWithoutARestart) {
  MadeCertificate brief = make_certificate("brief", &ca_, kNames);
  X509_gmtime_adj(X509_getm_notAfter(brief.certificate.get()), 4);
  ASSERT_GT(X509_sign(brief.certificate.get(), ca_.key.get(), EVP_sha256()), 0);
  start(ca_.certificate_pem(), brief);
  EXPECT_OK(met().status);
  EXPECT_TRUE(until([&] { return !met().status.ok(); }));
  EXPECT_TRUE(until([&] { return lines_with("has expired") > 0; }));
  install(make_certificate("renewed", &ca_, kNames));
  EXPECT_TRUE(until_both_are("renewed"));
}

}  // namespace
}  // namespace glasswing
