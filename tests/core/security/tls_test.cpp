#include "core/security/tls.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "core/file/file.h"
#include "core/service/service.h"
#include "glasswing/v1/clock_service.grpc.pb.h"
#include "tests/core/security/made_certificates.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

const char* const kPeer = "server at the rig";

// A server with a certificate for 127.0.0.1, and certificates for its callers.
class Tls : public testing::Test {
 protected:
  Tls() {
    write("ca", ca_);
    write("foreign-ca", foreign_ca_);
    write("me", make_certificate("me", &ca_, "URI:urn:glasswing:role:operator"));
    write("foreign", make_certificate("foreign", &foreign_ca_));
    write("old", make_certificate("old", &ca_, "", 0));
    write("server", make_certificate("server", &ca_, "IP:127.0.0.1,URI:urn:glasswing:role:server"));
    EXPECT_OK(use_tls(files("ca", "server")));
    server_ = ServiceHost::start({}, {}).value();
    address_ = server_->address();
  }
  ~Tls() override { (void)use_tls({}); }

  std::string file(const std::string& name) const { return (scratch_ / name).string(); }
  void write(const std::string& name, const MadeCertificate& made) const {
    ASSERT_OK(write_file_durably(file(name + ".pem"), made.certificate_pem()));
    ASSERT_OK(write_file_durably(file(name + ".key"), made.key_pem()));
  }
  TlsFiles files(const std::string& ca, const std::string& own) const {
    return {file(ca + ".pem"), own.empty() ? "" : file(own + ".pem"), own.empty() ? "" : file(own + ".key")};
  }

  static absl::Status call(const std::string& address, Roles roles = 0) {
    const auto stub = v1::ClockService::NewStub(dial(address, roles));
    grpc::ClientContext context;
    set_deadline(context, std::chrono::seconds(10));
    v1::ExchangeResponse response;
    return from_grpc(stub->Exchange(&context, {}, &response), kPeer);
  }
  std::string told(const TlsFiles& files, const std::string& host = "127.0.0.1") const {
    EXPECT_OK(use_tls(files));
    return std::string(call(host + address_.substr(address_.rfind(':'))).message());
  }

  const TemporaryDirectory scratch_;
  const MadeCertificate ca_ = make_certificate("ca"), foreign_ca_ = make_certificate("foreign ca");
  std::unique_ptr<ServiceHost> server_;
  std::string address_;
};

TEST_F(Tls, CallsGoThroughOnlyWhenEachKnowsTheOther) {
  EXPECT_EQ(told(files("ca", "me")), "");
  EXPECT_EQ(told(files("foreign-ca", "me")), std::string(kPeer) + " shows a certificate that the CA " +
                                                 file("foreign-ca.pem") +
                                                 " did not sign, or that has expired");
  EXPECT_EQ(told(files("ca", "")),
            std::string(kPeer) + " wants to know who calls; set --certificate and --key");
  EXPECT_EQ(told(files("ca", "foreign")), std::string(kPeer) + " refuses the certificate " +
                                              file("foreign.pem") + "; its own CA must have signed it");
  EXPECT_EQ(told(files("ca", "me"), "localhost"),
            std::string(kPeer) +
                " shows a certificate of another host; call it by a name that its certificate has");
}

// Calls by each of its names and addresses.
TEST_F(Tls, APeerWithoutTheWantedRoleGetsNoCall) {
  ASSERT_OK(use_tls(files("ca", "me")));
  EXPECT_OK(call(address_, only(Role::kServer)));
  EXPECT_OK(call(address_, only(Role::kServer) | only(Role::kCamera)));
  const absl::Status refused = call(address_, kArchiveKeepers);
  EXPECT_EQ(refused.code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(
      refused.message(),
      "server at the rig is not what it should be; its certificate's roles: server; it must have: camera or "
      "solver");
  // The host's name is still checked.
  const std::string elsewhere = "localhost" + address_.substr(address_.rfind(':'));
  EXPECT_EQ(call(elsewhere, only(Role::kServer)).message(), call(elsewhere).message());
  EXPECT_FALSE(call(elsewhere, only(Role::kServer)).ok());
}

TEST_F(Tls, AHostHasAllNamesOfItsCertificate) {
  const std::string own = "IP:127.0.0.1,IP:::1,DNS:localhost,URI:urn:glasswing:role:server";
  write("server", make_certificate("server", &ca_, own));
  ASSERT_OK(use_tls(files("ca", "server")));
  for (const std::string host : {"127.0.0.1", "localhost", "[::1]"}) {
    const auto listening = ServiceHost::start({.address = host + ":0"}, {});
    if (!listening.ok() && host == "[::1]") GTEST_SKIP() << "there is no IPv6 here";
    ASSERT_OK(listening);
    EXPECT_EQ(call((*listening)->address()).message(), "") << host;
  }
}

TEST_F(Tls, APlainServerIsNotCalledWithTls) {
  ASSERT_OK(use_tls({}));
  const auto plain = ServiceHost::start({}, {}).value();
  ASSERT_OK(use_tls(files("ca", "me")));
  EXPECT_EQ(call(plain->address()).message(),
            std::string(kPeer) + " does not speak TLS; if it need not, call it without a CA");
  ASSERT_OK(use_tls({}));
  EXPECT_OK(call(plain->address()));
}

TEST_F(Tls, ATlsServerTakesNoCallInTheClear) {
  EXPECT_EQ(told({}),
            std::string(kPeer) +
                " does not answer in the clear; if it speaks TLS, set --ca, --certificate and --key");
}

// A program cannot be started with such files, but a long-running one may come to have them.
TEST_F(Tls, CertificatesThatExpiredAreRefusedByBothSides) {
  const MadeCertificate old = make_certificate("old", &ca_, "IP:127.0.0.1", 0);
  const auto stub = v1::ClockService::NewStub(grpc::CreateChannel(
      address_, grpc::SslCredentials({ca_.certificate_pem(), old.key_pem(), old.certificate_pem()})));
  grpc::ClientContext context;
  set_deadline(context, std::chrono::seconds(10));
  v1::ExchangeResponse response;
  EXPECT_EQ(stub->Exchange(&context, {}, &response).error_code(), grpc::StatusCode::UNAVAILABLE);

  grpc::SslServerCredentialsOptions options(GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY);
  options.pem_root_certs = ca_.certificate_pem();
  options.pem_key_cert_pairs.push_back({old.key_pem(), old.certificate_pem()});
  v1::ClockService::Service service;
  grpc::ServerBuilder builder;
  int port = 0;
  builder.AddListeningPort("127.0.0.1:0", grpc::SslServerCredentials(options), &port);
  builder.RegisterService(&service);
  const std::unique_ptr<grpc::Server> server = builder.BuildAndStart();
  ASSERT_OK(use_tls(files("ca", "me")));
  EXPECT_EQ(call("127.0.0.1:" + std::to_string(port)).message(),
            std::string(kPeer) + " shows a certificate that the CA " + file("ca.pem") +
                " did not sign, or that has expired");
}

TEST_F(Tls, OtherMachinesAreListenedToWithACertificateOnly) {
  for (const TlsFiles& without : {TlsFiles(), files("ca", "")}) {
    ASSERT_OK(use_tls(without));
    const absl::Status status =
        ServiceHost::start({.address = "0.0.0.0:0", .advertised = "rig:1"}, {}).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status));
    EXPECT_EQ(
        status.message().find("--listen is 0.0.0.0:0, which other machines reach: they need TLS; set --ca, "
                              "--certificate and --key"),
        0u)
        << status;
  }
  ASSERT_OK(use_tls(files("ca", "server")));
  for (const char* everywhere : {"0.0.0.0:0", "[::]:0"}) {
    const absl::Status unnamed = ServiceHost::start({.address = everywhere}, {}).status();
    EXPECT_TRUE(absl::IsInvalidArgument(unnamed));
    EXPECT_NE(unnamed.message().find("set --advertise HOST:PORT"), std::string::npos) << unnamed;
  }
  for (const char* advertised : {"rig", "rig:", "rig:0", "rig:1:2", ":1", "0.0.0.0:1", "[::]:1", "a rig:1"}) {
    const absl::Status status =
        ServiceHost::start({.address = "0.0.0.0:0", .advertised = advertised}, {}).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << advertised << ": " << status;
  }
  for (const char* advertised : {"rig.example.org:7440", "192.0.2.1:7440", "[2001:db8::1]:7440"}) {
    const auto host = ServiceHost::start({.address = "0.0.0.0:0", .advertised = advertised}, {}).value();
    EXPECT_EQ(host->advertised(), advertised);
    EXPECT_OK(call("127.0.0.1" + host->address().substr(host->address().rfind(':'))));
  }
  EXPECT_EQ(server_->advertised(), server_->address());
}

TEST_F(Tls, WithFilesThatAreWrongNothingIsListenedOn) {
  const absl::Status problem = use_tls(files("ca", "old"));
  EXPECT_EQ(ServiceHost::start({}, {}).status(), problem);
  EXPECT_FALSE(problem.ok());
}

TEST_F(Tls, BeyondThisMachineNothingGoesInTheClear) {
  ASSERT_OK(use_tls({}));
  // 192.0.2.0/24 is reserved for documentation: no host answers there.
  for (const char* address : {"192.0.2.1:7440", "127.example.org:1", "[2001:db8::1]:7440"}) {
    EXPECT_EQ(call(address).message(), std::string(kPeer) +
                                           " is beyond this machine, where calls need TLS; set --ca, and "
                                           "--certificate and --key")
        << address;
  }
  EXPECT_TRUE(is_loopback("127.0.0.1:1"));
  EXPECT_TRUE(is_loopback("127.8.8.8:1"));
  EXPECT_TRUE(is_loopback("localhost:1"));
  EXPECT_TRUE(is_loopback("[::1]:1"));
}

TEST_F(Tls, NamesTheFileThatIsWrong) {
  ASSERT_OK(write_file_durably(file("words.pem"), "no certificate"));
  const struct {
    TlsFiles files;
    std::string words;
  } kCases[] = {
      {{file("ca.pem"), file("me.pem"), ""}, "the certificate " + file("me.pem") + " lacks its key"},
      {{file("ca.pem"), "", file("me.key")}, "the key " + file("me.key") + " lacks its certificate"},
      {{"", file("me.pem"), file("me.key")}, "the certificate " + file("me.pem") + " lacks the CA"},
      {{file("nowhere.pem"), "", ""}, "the CA cannot be read: "},
      {{file("words.pem"), "", ""}, "the CA is " + file("words.pem") + "; it must be a certificate in PEM"},
      {{file("ca.pem"), file("words.pem"), file("me.key")},
       "the certificate is " + file("words.pem") + "; it must be"},
      {{file("ca.pem"), file("me.pem"), file("words.pem")},
       "the key is " + file("words.pem") + "; it must be a private key in PEM"},
      {{file("ca.pem"), file("me.pem"), file("foreign.key")},
       "the key " + file("foreign.key") + " does not belong to the certificate " + file("me.pem")},
      {{file("ca.pem"), file("old.pem"), file("old.key")},
       "the certificate " + file("old.pem") + " has expired"}};
  for (const auto& [files, words] : kCases) {
    const absl::Status status = use_tls(files);
    EXPECT_TRUE(absl::IsInvalidArgument(status));
    EXPECT_EQ(status.message().find(words), 0u) << status.message();
    // Later calls fail with the problem rather than going out in the clear.
    EXPECT_EQ(call(address_).message(), status.message());
  }
}

}  // namespace
}  // namespace glasswing
