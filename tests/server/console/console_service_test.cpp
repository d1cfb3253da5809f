#include "server/console/console_service.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "core/file/file.h"
#include "core/security/pem.h"
#include "core/security/tls.h"
#include "core/service/service.h"
#include "tests/core/security/made_certificates.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

class ConsoleServiceTest : public testing::Test {
 protected:
  ~ConsoleServiceTest() override {
    server_.reset();
    (void)use_tls({});
  }

  void start() {
    tokens_ = AccessTokens::open(scratch_, problems_).value();
    service_ = std::make_unique<ConsoleServiceImpl>(*tokens_);
    server_ = ServiceHost::start({}, {service_.get()}, [this](const std::string& login) {
                return tokens_->principal_of(login, AccessTokens::current_time());
              }).value();
    stub_ = v1::ConsoleService::NewStub(dial(server_->address()));
  }
  template <typename Request, typename Response>
  absl::StatusOr<Response> call(grpc::Status (v1::ConsoleService::Stub::*method)(grpc::ClientContext*,
                                                                                 const Request&, Response*),
                                const Request& request, const std::string& login = "") {
    grpc::ClientContext context;
    set_deadline(context, std::chrono::seconds(20));
    if (!login.empty()) context.AddMetadata(kLoginMetadata, login);
    Response response;
    const grpc::Status status = (stub_.get()->*method)(&context, request, &response);
    if (!status.ok()) return from_grpc(status);
    return response;
  }
  static v1::CreateTokenRequest request(double hours, const std::string& role = "viewer") {
    v1::CreateTokenRequest request;
    request.set_name("berta");
    request.set_role(role);
    request.set_valid_hours(hours);
    return request;
  }
  absl::Status announce(const std::string& url) {
    v1::AnnounceRequest request;
    request.set_url(url);
    return call(&v1::ConsoleService::Stub::Announce, request).status();
  }
  absl::StatusOr<v1::LogInResponse> log_in(const std::string& token) {
    v1::LogInRequest request;
    request.set_token(token);
    return call(&v1::ConsoleService::Stub::LogIn, request);
  }
  absl::StatusOr<v1::GetPrincipalResponse> principal_of(const std::string& login) {
    v1::GetPrincipalRequest request;
    request.set_login(login);
    return call(&v1::ConsoleService::Stub::GetPrincipal, request);
  }

  Problems problems_;
  const TemporaryDirectory scratch_;
  std::unique_ptr<AccessTokens> tokens_;
  std::unique_ptr<ConsoleServiceImpl> service_;
  std::unique_ptr<ServiceHost> server_;
  std::unique_ptr<v1::ConsoleService::Stub> stub_;
};

constexpr auto kCreate = &v1::ConsoleService::Stub::CreateToken;

TEST_F(ConsoleServiceTest, ATokenNeedsAConsoleToLogInTo) {
  start();
  EXPECT_EQ(call(kCreate, request(1.0)).status().code(), absl::StatusCode::kFailedPrecondition);
  for (const char* url : {"", "ftp://rig.lab:7480", "http://rig.lab", "http://rig.lab:7480/", "http://a b:1",
                          "http://rig.lab:7480#token=x", "http://anna@rig.lab:7480", "http://rig\n:7480"})
    EXPECT_EQ(announce(url).code(), absl::StatusCode::kInvalidArgument) << url;
  for (const char* url : {"http://127.0.0.1:1", "https://[::1]:7480", "https://rig.lab:7480"}) {
    EXPECT_OK(announce(url)) << url;
    EXPECT_EQ(call(kCreate, request(1.0))->url(), url);
  }
  EXPECT_EQ(call(kCreate, request(0.0)).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST_F(ConsoleServiceTest, AConsoleThatIsJustStartingIsWaitedFor) {
  start();
  std::jthread console([this] { EXPECT_OK(announce("http://127.0.0.1:1")); });
  EXPECT_OK(call(kCreate, request(1.0)));
}

TEST_F(ConsoleServiceTest, ALoginIsKnownUntilItsLogout) {
  start();
  ASSERT_OK(announce("http://127.0.0.1:1"));
  const v1::CreateTokenResponse token = call(kCreate, request(1.0, "operator")).value();
  const v1::LogInResponse login = log_in(token.token()).value();
  EXPECT_EQ(login.principal().name(), "berta");
  EXPECT_EQ(login.principal().role(), "operator");
  EXPECT_EQ(login.principal().token_id(), token.id());
  EXPECT_EQ(principal_of(login.login())->principal().SerializeAsString(),
            login.principal().SerializeAsString());
  for (const std::string& secret : {token.token(), std::string("guess"), std::string()})
    EXPECT_EQ(principal_of(secret).status().code(), absl::StatusCode::kUnauthenticated);
  EXPECT_EQ(log_in(login.login()).status().code(), absl::StatusCode::kUnauthenticated);
  v1::LogOutRequest out;
  out.set_login(login.login());
  EXPECT_OK(call(&v1::ConsoleService::Stub::LogOut, out));
  EXPECT_EQ(principal_of(login.login()).status().code(), absl::StatusCode::kUnauthenticated);
  EXPECT_OK(call(&v1::ConsoleService::Stub::LogOut, out)) << "twice";
}

// Without TLS too, where all others may do everything.
TEST_F(ConsoleServiceTest, ACallWithALoginHasItsRoleAndItsName) {
  start();
  ASSERT_OK(announce("http://127.0.0.1:1"));
  const auto login_of = [&](const std::string& role) {
    return log_in(call(kCreate, request(1.0, role))->token())->login();
  };
  const std::string viewer = login_of("viewer"), owner = login_of("operator");
  EXPECT_EQ(call(kCreate, request(1.0), viewer).status().code(), absl::StatusCode::kPermissionDenied);
  EXPECT_EQ(call(kCreate, request(1.0), "guess").status().code(), absl::StatusCode::kUnauthenticated);
  const v1::CreateTokenResponse made = call(kCreate, request(8760.0), owner).value();
  for (const AccessToken& token : tokens_->list(AccessTokens::current_time()).value()) {
    if (token.id != made.id()) continue;
    EXPECT_EQ(token.made_by, "berta (console)");
    EXPECT_LE(token.expires, AccessTokens::current_time() + std::chrono::hours(1)) << "its maker's";
  }
}

TEST_F(ConsoleServiceTest, ATokenEndsWithTheCertificateOfItsMaker) {
  const MadeCertificate ca = make_certificate("ca");
  const auto write = [&](const std::string& file, const std::string& pem) {
    EXPECT_OK(write_file_durably(scratch_ / file, pem));
    return (scratch_ / file).string();
  };
  // Of the test's own process: the server's certificate and the callers'.
  const MadeCertificate own =
      make_certificate("anna", &ca, fmt::format("IP:127.0.0.1,URI:{0}operator,URI:{0}console", kRoleUri), 3);
  ASSERT_OK(use_tls({write("ca.pem", ca.certificate_pem()), write("own.pem", own.certificate_pem()),
                     write("own.key", own.key_pem())}));
  start();
  ASSERT_OK(announce("https://rig.lab:7480"));
  const v1::CreateTokenResponse response = call(kCreate, request(8760.0)).value();
  const std::vector<AccessToken> valid = tokens_->list(AccessTokens::current_time()).value();
  ASSERT_EQ(valid.size(), 1u);
  EXPECT_EQ(valid[0].id, response.id());
  EXPECT_EQ(valid[0].made_by, "anna");
  EXPECT_EQ(valid[0].expires, end_of(*own.certificate));
}

}  // namespace
}  // namespace glasswing
