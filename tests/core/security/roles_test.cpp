#include "core/security/roles.h"

#include <fmt/format.h>
#include <google/protobuf/descriptor.h>
#include <grpcpp/generic/generic_stub.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <set>
#include <tuple>
#include <vector>

#include "core/file/file.h"
#include "core/security/tls.h"
#include "core/service/service.h"
#include "glasswing/v1/archive_service.grpc.pb.h"
#include "glasswing/v1/axis_service.grpc.pb.h"
#include "glasswing/v1/calibration_service.grpc.pb.h"
#include "glasswing/v1/camera_service.grpc.pb.h"
#include "glasswing/v1/clock_service.grpc.pb.h"
#include "glasswing/v1/console_service.grpc.pb.h"
#include "glasswing/v1/display_service.grpc.pb.h"
#include "glasswing/v1/emission_service.grpc.pb.h"
#include "glasswing/v1/fleet_service.grpc.pb.h"
#include "glasswing/v1/job_service.grpc.pb.h"
#include "glasswing/v1/live_service.grpc.pb.h"
#include "glasswing/v1/matte_service.grpc.pb.h"
#include "glasswing/v1/node_service.grpc.pb.h"
#include "glasswing/v1/queue_service.grpc.pb.h"
#include "glasswing/v1/rig_service.grpc.pb.h"
#include "glasswing/v1/session_service.grpc.pb.h"
#include "glasswing/v1/stage_service.grpc.pb.h"
#include "glasswing/v1/storage_service.grpc.pb.h"
#include "glasswing/v1/work_service.grpc.pb.h"
#include "tests/core/security/made_certificates.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

// All services of a lab, none of them implemented: a call that is admitted is UNIMPLEMENTED.
using Services =
    std::tuple<v1::ArchiveService::Service, v1::CalibrationService::Service, v1::CameraService::Service,
               v1::ConsoleService::Service, v1::DisplayService::Service, v1::EmissionService::Service,
               v1::FleetService::Service, v1::JobService::Service, v1::LiveService::Service,
               v1::MatteService::Service, v1::NodeService::Service, v1::QueueService::Service,
               v1::RigService::Service, v1::SessionService::Service, v1::AxisService::Service,
               v1::StageService::Service, v1::StorageService::Service, v1::WorkService::Service>;

// "WorkService/ClaimTile" and so on, from all proto files that are linked here.
std::set<std::string> all_methods() {
  (void)v1::RunLiveRequest::descriptor();  // links its file
  std::set<std::string> methods;
  for (const char* name : {"archive",  "axis",  "calibration", "camera", "clock",   "console", "display",
                           "emission", "fleet", "job",         "live",   "log",     "matte",   "node",
                           "queue",    "rig",   "session",     "stage",  "storage", "work"}) {
    const auto* file = google::protobuf::DescriptorPool::generated_pool()->FindFileByName(
        fmt::format("glasswing/v1/{}_service.proto", name));
    EXPECT_NE(file, nullptr) << name;
    for (int s = 0; file != nullptr && s < file->service_count(); ++s) {
      for (int m = 0; m < file->service(s)->method_count(); ++m)
        methods.insert(file->service(s)->name() + "/" + file->service(s)->method(m)->name());
    }
  }
  return methods;
}

class Roles : public testing::Test {
 protected:
  Roles() {
    show("rig", "IP:127.0.0.1");
    server_ = started(services_);
  }
  ~Roles() override { (void)use_tls({}); }

  // Makes this process show a certificate with these names from now on.
  void show(const std::string& name, const std::string& names) const {
    const MadeCertificate own = make_certificate(name, &ca_, names);
    const auto write = [&](const std::string& file, const std::string& pem) {
      const std::string path = (scratch_ / file).string();
      EXPECT_OK(write_file_durably(path, pem));
      return path;
    };
    const TlsFiles files{write("ca.pem", ca_.certificate_pem()), write(name + ".pem", own.certificate_pem()),
                         write(name + ".key", own.key_pem())};
    EXPECT_OK(use_tls(files));
  }
  static std::unique_ptr<ServiceHost> started(Services& services, PrincipalOf principal_of = nullptr) {
    const auto all =
        std::apply([](auto&... each) { return std::vector<grpc::Service*>{&each...}; }, services);
    return ServiceHost::start({}, all, std::move(principal_of)).value();
  }

  std::shared_ptr<grpc::Channel> channel_of(const MadeCertificate* own,
                                            const MadeCertificate& trusted) const {
    grpc::SslCredentialsOptions options;
    options.pem_root_certs = trusted.certificate_pem();
    if (own != nullptr) {
      options.pem_private_key = own->key_pem();
      options.pem_cert_chain = own->certificate_pem();
    }
    return grpc::CreateChannel(server_->address(), grpc::SslCredentials(options));
  }
  std::shared_ptr<grpc::Channel> channel_with(const std::string& names,
                                              const std::string& who = "somebody") const {
    const MadeCertificate own = make_certificate(who, &ca_, names);
    return channel_of(&own, ca_);
  }
  // One call with an empty message, for the people with these logins.
  static grpc::Status call(const std::shared_ptr<grpc::Channel>& channel, const std::string& method,
                           const std::vector<std::string>& logins = {}) {
    grpc::GenericStub stub(channel);
    grpc::ClientContext context;
    set_deadline(context, std::chrono::seconds(20));
    for (const std::string& login : logins) context.AddMetadata(kLoginMetadata, login);
    grpc::CompletionQueue queue;
    const grpc::Slice empty;
    const grpc::ByteBuffer nothing(&empty, 1);
    const auto calling = stub.PrepareUnaryCall(&context, "/glasswing.v1." + method, nothing, &queue);
    calling->StartCall();
    grpc::ByteBuffer answer;
    grpc::Status status;
    calling->Finish(&answer, &status, nullptr);
    void* tag = nullptr;
    bool ok = false;
    queue.Next(&tag, &ok);
    return status;
  }

  const TemporaryDirectory scratch_;
  const MadeCertificate ca_ = make_certificate("ca"), foreign_ca_ = make_certificate("foreign ca");
  Services services_;
  std::unique_ptr<ServiceHost> server_;
};

TEST_F(Roles, TheTableHasEveryMethodOnce) {
  std::set<std::string> listed;
  for (const MethodAccess& access : access_table()) {
    EXPECT_TRUE(listed.insert(std::string(access.method)).second) << access.method << " is there twice";
    EXPECT_NE(access.roles, 0u) << access.method;
  }
  EXPECT_EQ(listed, all_methods());
}

TEST_F(Roles, EveryMethodAnswersItsRolesAndNoOther) {
  const std::set<std::string> methods = all_methods();
  for (size_t r = 0; r < kRoleNames.size(); ++r) {
    const auto channel = channel_with(fmt::format("URI:{}{}", kRoleUri, kRoleNames[r]));
    for (const MethodAccess& access : access_table()) {
      const grpc::Status status = call(channel, std::string(access.method));
      const bool in = status.error_code() == grpc::StatusCode::UNIMPLEMENTED || status.ok();
      EXPECT_EQ(in, access.allows(static_cast<Role>(r))) << access.method << " by " << kRoleNames[r];
      if (!in) {
        EXPECT_EQ(status.error_code(), grpc::StatusCode::PERMISSION_DENIED) << access.method;
      }
    }
  }
}

// Who may enqueue, approve, run and delete, each alone.
TEST_F(Roles, PeopleMayWhatTheirRoleSaysAndLook) {
  const std::map<std::string, std::string> kOwn{{"planner", "QueueService/AddQueueItem"},
                                                {"approver", "QueueService/ApproveQueueItem"},
                                                {"runner", "SessionService/CreateSession"},
                                                {"deleter", "SessionService/DeleteSession"}};
  for (const auto& [role, own] : kOwn) {
    const auto channel = channel_with(fmt::format("URI:{}{}", kRoleUri, role));
    EXPECT_EQ(call(channel, "SessionService/GetSession").error_code(), grpc::StatusCode::UNIMPLEMENTED)
        << role;
    for (const auto& [other, method] : kOwn) {
      EXPECT_EQ(call(channel, method).error_code(),
                role == other ? grpc::StatusCode::UNIMPLEMENTED : grpc::StatusCode::PERMISSION_DENIED)
          << method << " by " << role;
    }
    EXPECT_EQ(call(channel, "RigService/ForgetCalibration").error_code(),
              grpc::StatusCode::PERMISSION_DENIED);
  }
}

TEST_F(Roles, WithoutACertificateOfThisLabNoMethodAnswers) {
  const std::string operator_role = fmt::format("URI:{}operator", kRoleUri);
  const MadeCertificate expired = make_certificate("old", &ca_, operator_role, 0);
  const MadeCertificate foreign = make_certificate("foreign", &foreign_ca_, operator_role);
  const MadeCertificate good = make_certificate("me", &ca_, operator_role);
  const struct {
    const char* what;
    std::shared_ptr<grpc::Channel> channel;
  } kCallers[] = {
      {"no certificate", channel_of(nullptr, ca_)},
      {"an expired one", channel_of(&expired, ca_)},
      {"one of a foreign CA", channel_of(&foreign, ca_)},
      {"one that trusts another CA", channel_of(&good, foreign_ca_)},
      {"none, in the clear", grpc::CreateChannel(server_->address(), grpc::InsecureChannelCredentials())}};
  for (const auto& [what, channel] : kCallers) {
    for (const MethodAccess& access : access_table())
      EXPECT_EQ(call(channel, std::string(access.method)).error_code(), grpc::StatusCode::UNAVAILABLE)
          << access.method << " with " << what;
  }
}

// An impostor with any certificate of the lab in place of another peer.
TEST_F(Roles, AServerThatShowsTheCertificateOfAnotherHostIsNotCalled) {
  const std::string every_role = [] {
    std::string names;
    for (const std::string_view role : kRoleNames) names += fmt::format(",URI:{}{}", kRoleUri, role);
    return names;
  }();
  for (const std::string& names :
       {std::string("IP:127.0.0.2"), std::string("DNS:localhost"), std::string("DNS:127.0.0.1.example.org"),
        std::string("URI:https://127.0.0.1/")}) {
    show("impostor", names + every_role);
    Services services;
    const auto impostor = started(services);
    show("me", "DNS:me" + every_role);
    const auto channel = dial(impostor->address());
    for (const MethodAccess& access : access_table()) {
      const grpc::Status status = call(channel, std::string(access.method));
      EXPECT_EQ(status.error_code(), grpc::StatusCode::UNAVAILABLE) << access.method << " of " << names;
      EXPECT_EQ(tls_failure(status, "it"),
                "it shows a certificate of another host; call it by a name that its certificate has")
          << status.error_message();
    }
  }
}

TEST_F(Roles, CertificatesWithoutARoleOrWithAnUnknownOneMayNothing) {
  for (const std::string& names :
       {std::string("DNS:solver"), fmt::format("URI:{}admin", kRoleUri), fmt::format("URI:{}", kRoleUri),
        std::string("URI:urn:glasswing:roles:operator"), fmt::format("URI:{}Operator", kRoleUri)}) {
    const auto channel = channel_with(names);
    for (const MethodAccess& access : access_table())
      EXPECT_EQ(call(channel, std::string(access.method)).error_code(), grpc::StatusCode::PERMISSION_DENIED)
          << access.method << " with " << names;
  }
}

TEST_F(Roles, RolesAddUpAndARefusalSaysWhichAreWanted) {
  const auto both = channel_with(fmt::format("URI:{0}viewer,URI:{0}solver", kRoleUri), "desk");
  EXPECT_EQ(call(both, "WorkService/ClaimTile").error_code(), grpc::StatusCode::UNIMPLEMENTED);
  EXPECT_EQ(call(both, "SessionService/GetSession").error_code(), grpc::StatusCode::UNIMPLEMENTED);
  EXPECT_EQ(call(both, "SessionService/DeleteSession").error_message(),
            "SessionService/DeleteSession is for the roles operator, deleter; \"desk\" has viewer, "
            "solver");
}

// A login's secret is its role.
absl::StatusOr<Principal> principal_of(const std::string& login) {
  const glasswing::Roles roles = role_of_uri(std::string(kRoleUri) + login);
  if ((roles & (only(Role::kOperator) | only(Role::kViewer))) == 0)
    return absl::UnauthenticatedError("this login has ended");
  return Principal{.name = "berta", .roles = roles, .token = "7a"};
}

const std::string kConsoleUri = std::string("URI:") + std::string(kRoleUri) + "console";

TEST_F(Roles, AConsoleAloneKnowsLoginsAndLooksAtNodes) {
  const auto channel = channel_with(kConsoleUri);
  std::set<std::string> may;
  for (const std::string& method : all_methods()) {
    const grpc::StatusCode code = call(channel, method).error_code();
    if (code != grpc::StatusCode::PERMISSION_DENIED) may.insert(method);
  }
  EXPECT_EQ(may, (std::set<std::string>{
                     "ArchiveService/GetManifest", "ArchiveService/GetSpace", "ArchiveService/ListArchives",
                     "ArchiveService/PutFrame", "ArchiveService/ReadFile", "ArchiveService/ReadRows",
                     "AxisService/GetAxes", "CameraService/GetCamera", "CameraService/Preview",
                     "ConsoleService/Announce", "ConsoleService/GetPrincipal", "ConsoleService/LogIn",
                     "ConsoleService/LogOut", "DisplayService/GetDisplay", "LogService/ListWarnings"}));
}

TEST_F(Roles, WithALoginAConsoleMayWhatItsOwnerMay) {
  server_ = started(services_, principal_of);
  const auto channel = channel_with(kConsoleUri);
  for (const auto& [role, name] : {std::pair(Role::kViewer, "viewer"), {Role::kOperator, "operator"}}) {
    for (const MethodAccess& access : access_table()) {
      const grpc::StatusCode code = call(channel, std::string(access.method), {name}).error_code();
      EXPECT_EQ(code == grpc::StatusCode::PERMISSION_DENIED, !access.allows(role))
          << access.method << " for a " << name;
    }
  }
  EXPECT_EQ(
      call(channel, "SessionService/DeleteSession", {"viewer"}).error_message(),
      "SessionService/DeleteSession is for the roles operator, deleter; \"berta (token 7a)\" has viewer");
  EXPECT_EQ(call(channel, "SessionService/GetSession", {"ended"}).error_code(),
            grpc::StatusCode::UNAUTHENTICATED);
  EXPECT_EQ(call(channel, "SessionService/GetSession", {"viewer", "operator"}).error_code(),
            grpc::StatusCode::INVALID_ARGUMENT);
}

TEST_F(Roles, ALoginIsForConsolesAndServers) {
  EXPECT_EQ(call(channel_with(kConsoleUri), "CameraService/GetCamera", {"viewer"}).error_message(),
            "only the server takes calls with a login");
  server_ = started(services_, principal_of);
  for (const std::string_view role : kRoleNames) {
    if (role == "console") continue;
    const auto channel = channel_with(fmt::format("URI:{}{}", kRoleUri, role));
    for (const MethodAccess& access : access_table())
      EXPECT_EQ(call(channel, std::string(access.method), {"operator"}).error_code(),
                grpc::StatusCode::PERMISSION_DENIED)
          << access.method << " by " << role;
  }
}

TEST_F(Roles, WithoutTlsOnlyCallsWithALoginAreChecked) {
  ASSERT_OK(use_tls({}));
  server_ = started(services_, principal_of);
  const auto channel = grpc::CreateChannel(server_->address(), grpc::InsecureChannelCredentials());
  for (const MethodAccess& access : access_table()) {
    const std::string method(access.method);
    EXPECT_NE(call(channel, method).error_code(), grpc::StatusCode::PERMISSION_DENIED) << method;
    EXPECT_EQ(call(channel, method, {"viewer"}).error_code() == grpc::StatusCode::PERMISSION_DENIED,
              !access.allows(Role::kViewer))
        << method;
  }
  const auto elsewhere = ServiceHost::start({.address = "127.0.0.2:0"}, {}, principal_of);
  EXPECT_EQ(elsewhere.status().message(),
            "--listen is 127.0.0.2:0; without TLS it must be 127.0.0.1:PORT, [::1]:PORT or localhost:PORT");
}

}  // namespace
}  // namespace glasswing
