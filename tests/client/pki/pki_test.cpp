#include <sys/stat.h>

#include <cstdio>
#include <nlohmann/json.hpp>
#include <set>
#include <thread>

#include "client/pki/certificate_authority.h"
#include "core/file/file.h"
#include "core/security/tls.h"
#include "core/service/service.h"
#include "glasswing/v1/clock_service.grpc.pb.h"
#include "tests/client/run_glasswing.h"
#include "tests/core/security/made_certificates.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

// The certificates are checked with the program `openssl`, not with the library that made them.
class Pki : public ScratchTest {
 protected:
  std::string path(const std::string& name) const { return (lab_ / name).string(); }
  std::string bytes(const std::string& name) const { return read_file(lab_ / name).value(); }

  Outcome pki(const std::string& command, std::vector<std::string> arguments = {}) const {
    arguments.insert(arguments.begin(), {"pki", command, lab_.string()});
    return run_glasswing(arguments);
  }
  json answer(const std::string& command, std::vector<std::string> arguments = {}) const {
    arguments.push_back("--json");
    const Outcome outcome = pki(command, arguments);
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    return json::parse(outcome.out, nullptr, false);
  }
  void refused(const std::string& command, const std::vector<std::string>& arguments,
               const std::string& words) const {
    const std::set<std::string> before = files();
    expect_one_line_error(pki(command, arguments), words);
    EXPECT_EQ(files(), before);
  }
  std::set<std::string> files() const {
    std::set<std::string> names;
    std::error_code ignored;
    for (const auto& entry : fs::directory_iterator(lab_, ignored)) names.insert(entry.path().filename());
    return names;
  }
  // Runs in the lab's directory; returns the output and, at the end, the exit status.
  std::string openssl(const std::string& arguments) const {
    std::string text;
    FILE* const pipe = ::popen(
        ("cd '" + lab_.string() + "' && openssl " + arguments + " 2>&1; echo \"exit $?\"").c_str(), "r");
    for (char part[4096]; std::fgets(part, sizeof part, pipe) != nullptr;) text += part;
    ::pclose(pipe);
    return text;
  }
  void expect_says(const std::string& text, const std::string& words) const {
    EXPECT_NE(text.find(words), std::string::npos) << text << "does not say " << words;
  }
  static unsigned mode_of(const fs::path& file) {
    struct stat info {};
    EXPECT_EQ(::stat(file.c_str(), &info), 0);
    return info.st_mode & 0777u;
  }

  const fs::path lab_ = scratch_ / "lab";
  const bool has_openssl_ = std::system("openssl version >/dev/null 2>&1") == 0;
};

#define NEEDS_OPENSSL \
  if (!has_openssl_) GTEST_SKIP() << "there is no openssl program"

TEST_F(Pki, AnAuthorityMaySignCertificatesAndNothingElse) {
  NEEDS_OPENSSL;
  const mode_t mask = ::umask(022);
  const json made = answer("init", {"--name", "Lab 3"});
  ::umask(mask);
  EXPECT_EQ(made["authority"]["name"], "Lab 3");
  EXPECT_EQ(files(), (std::set<std::string>{"ca.key", "ca.pem"}));
  EXPECT_EQ(mode_of(lab_), 0700u);
  EXPECT_EQ(mode_of(lab_ / "ca.key"), 0600u);
  EXPECT_EQ(mode_of(lab_ / "ca.pem"), 0644u);
  expect_says(openssl("verify -x509_strict -CAfile ca.pem ca.pem"), "ca.pem: OK\nexit 0");
  const std::string text = openssl("x509 -in ca.pem -noout -text");
  expect_says(text, "Subject: CN = Lab 3");
  expect_says(text, "Basic Constraints: critical\n                CA:TRUE, pathlen:0");
  expect_says(text, "Key Usage: critical\n                Certificate Sign, CRL Sign");
  expect_says(text, "NIST CURVE: P-256");
  expect_says(text, "Signature Algorithm: ecdsa-with-SHA256");
  expect_says(openssl("pkey -in ca.key -check -noout"), "Key is valid\nexit 0");
}

TEST_F(Pki, AnAuthorityIsNeverOverwritten) {
  ASSERT_EQ(pki("init").status, 0);
  const std::string certificate = bytes("ca.pem"), key = bytes("ca.key");
  refused("init", {}, path("ca.pem") + " already exists; another authority needs another directory");
  EXPECT_EQ(bytes("ca.pem"), certificate);
  EXPECT_EQ(bytes("ca.key"), key);
  fs::remove(lab_ / "ca.pem");
  refused("init", {}, path("ca.key") + " exists without ca.pem; put that back, or remove the key");
  EXPECT_EQ(bytes("ca.key"), key);
}

TEST_F(Pki, CertificatesSayWhoMayDoWhatAndWhere) {
  NEEDS_OPENSSL;
  ASSERT_EQ(pki("init").status, 0);
  const json made =
      answer("issue", {"server+camera:rig=rig.lab,10.0.0.5,2001:db8::1", "operator:me", "--days", "10"});
  EXPECT_EQ(made["certificates"][0]["hosts"], json::array({"rig.lab", "10.0.0.5", "2001:db8::1"}));
  EXPECT_EQ(made["certificates"][0]["roles"], json::array({"server", "camera"}));
  EXPECT_EQ(made["certificates"][1]["hosts"], json::array({"me"}));
  EXPECT_EQ(mode_of(lab_ / "rig.key"), 0600u);
  for (const char* purpose : {"sslserver", "sslclient"}) {
    expect_says(
        openssl(std::string("verify -x509_strict -CAfile ca.pem -purpose ") + purpose + " rig.pem me.pem"),
        "rig.pem: OK\nme.pem: OK\nexit 0");
  }
  for (const char* host : {"-verify_hostname rig.lab", "-verify_ip 10.0.0.5", "-verify_ip 2001:db8::1"})
    expect_says(openssl(std::string("verify -CAfile ca.pem ") + host + " rig.pem"), "exit 0");
  expect_says(openssl("verify -CAfile ca.pem -verify_hostname other.lab rig.pem"), "exit 2");
  const std::string text = openssl("x509 -in rig.pem -noout -text");
  expect_says(text, "Subject: CN = rig\n");
  expect_says(text, "Basic Constraints: critical\n                CA:FALSE");
  expect_says(text, "Key Usage: critical\n                Digital Signature\n");
  expect_says(text, "TLS Web Server Authentication, TLS Web Client Authentication\n");
  expect_says(
      text,
      "DNS:rig.lab, IP Address:10.0.0.5, IP Address:2001:DB8:0:0:0:0:0:1, URI:urn:glasswing:role:server, "
      "URI:urn:glasswing:role:camera\n");
  EXPECT_EQ(openssl("x509 -in rig.pem -noout -pubkey"), openssl("pkey -in rig.key -pubout"));
  // Ten days from when it was made, which is less than a minute ago.
  expect_says(openssl("x509 -in rig.pem -noout -checkend 863940"), "exit 0");
  expect_says(openssl("x509 -in rig.pem -noout -checkend 864001"), "exit 1");
  EXPECT_NE(openssl("x509 -in rig.pem -noout -serial"), openssl("x509 -in me.pem -noout -serial"));
}

TEST_F(Pki, WhatIsNoRequestMakesNothing) {
  ASSERT_EQ(pki("init").status, 0);
  const struct {
    const char *request, *words;
  } kCases[] = {
      {"rig", "rig: it must be ROLE:NAME or ROLE:NAME=HOST,HOST..."},
      {"admin:rig",
       "\"admin\" is not a role; the roles are operator, viewer, server, display, camera, solver, console, "
       "planner, approver, runner, deleter"},
      {"server+:rig", "\"\" is not a role"},
      {"server+server:rig", "\"server\" is there twice"},
      {"server:", "the name is \"\""},
      {"server:../rig", "the name is \"../rig\"; it must be"},
      {"server:ca", "and not ca"},
      {"server:rig=", "\"\" is not a host"},
      {"server:rig=a,a", "\"a\" is there twice"},
      {"server:rig=10.0.0.256", "\"10.0.0.256\" is not a host; it must be"},
      {"server:rig=*.lab", "\"*.lab\" is not a host"},
      {"server:rig=rig.lab\nURI:urn:glasswing:role:operator", "is not a host"}};
  for (const auto& [request, words] : kCases) refused("issue", {"solver:good", request}, words);
  refused("issue", {"solver:good", "--days", "4000"}, "4000");
}

TEST_F(Pki, NothingOutlivesItsAuthority) {
  fs::create_directory(lab_);
  const auto install = [&](const MadeCertificate& ca) {
    ASSERT_OK(write_file_durably(lab_ / "ca.pem", ca.certificate_pem()));
    ASSERT_OK(write_file_durably(lab_ / "ca.key", ca.key_pem()));
  };
  install(make_certificate("ca", nullptr, "", 5));  // from yesterday on
  refused("issue", {"solver:a", "--days", "5"},
          "--days is 5; the authority " + path("ca.pem") + " is valid for ");
  EXPECT_EQ(pki("issue", {"solver:a", "--days", "3"}).status, 0);
  install(make_certificate("ca", nullptr, "", 0));
  refused("issue", {"solver:b", "--days", "1"}, "the authority " + path("ca.pem") + " has expired");
}

TEST_F(Pki, WhatIsThereIsRenewedRatherThanIssued) {
  NEEDS_OPENSSL;
  ASSERT_EQ(pki("init").status, 0);
  ASSERT_EQ(pki("issue", {"server+camera:rig=rig.lab,10.0.0.5", "--days", "20"}).status, 0);
  ASSERT_EQ(pki("issue", {"solver:far", "--days", "40"}).status, 0);
  const std::string rig = bytes("rig.pem"), key = bytes("rig.key"), far = bytes("far.pem");
  const std::string names = openssl("x509 -in rig.pem -noout -subject -ext subjectAltName,extendedKeyUsage");
  refused("issue", {"solver:new", "viewer:rig"},
          path("rig.pem") + " already exists; glasswing pki renew " + lab_.string() + " rig replaces it");
  EXPECT_EQ(bytes("rig.pem"), rig);

  const json renewed = answer("renew");  // what expires within 30 days
  ASSERT_EQ(renewed["certificates"].size(), 1u);
  EXPECT_EQ(renewed["certificates"][0]["name"], "rig");
  EXPECT_EQ(bytes("far.pem"), far);
  EXPECT_NE(bytes("rig.key"), key);
  EXPECT_EQ(mode_of(lab_ / "rig.key"), 0600u);
  EXPECT_EQ(openssl("x509 -in rig.pem -noout -subject -ext subjectAltName,extendedKeyUsage"), names);
  EXPECT_EQ(openssl("x509 -in rig.pem -noout -pubkey"), openssl("pkey -in rig.key -pubout"));
  expect_says(openssl("verify -x509_strict -CAfile ca.pem rig.pem"), "rig.pem: OK");
  expect_says(openssl("x509 -in rig.pem -noout -checkend 31449600"), "exit 0");  // 364 days
  EXPECT_EQ(files(), (std::set<std::string>{"ca.key", "ca.pem", "far.key", "far.pem", "rig.key", "rig.pem"}));

  EXPECT_EQ(pki("renew").out, "No certificate expires within 30 days.\n");
  EXPECT_EQ(answer("renew", {"--within", "50"})["certificates"][0]["name"], "far");
  EXPECT_EQ(answer("renew", {"far", "rig"})["certificates"].size(), 2u);
  refused("renew", {"nobody"}, "there is no " + path("nobody.pem"));
  refused("renew", {"ca"}, "and not ca");
}

TEST_F(Pki, ListsWhatItIssuedWithoutItsKey) {
  refused("list", {}, lab_.string() + " has no authority, ca.pem; glasswing pki init");
  ASSERT_EQ(pki("init").status, 0);
  ASSERT_EQ(pki("issue", {"solver:b", "server+display:a=a.lab"}).status, 0);
  // One signed by another authority, and one without alternative names.
  ASSERT_EQ(run_glasswing({"pki", "init", (scratch_ / "other").string()}).status, 0);
  ASSERT_EQ(run_glasswing({"pki", "issue", (scratch_ / "other").string(), "operator:stranger"}).status, 0);
  fs::copy_file(scratch_ / "other" / "stranger.pem", lab_ / "stranger.pem");
  refused("renew", {"stranger"}, path("stranger.pem") + " was not signed by the authority beside it");
  fs::remove(lab_ / "ca.key");
  const json listed = answer("list");
  EXPECT_EQ(listed["authority"]["name"], "Glasswing lab");
  ASSERT_EQ(listed["certificates"].size(), 2u);
  EXPECT_EQ(listed["certificates"][0]["name"], "a");
  EXPECT_EQ(listed["certificates"][0]["roles"], json::array({"server", "display"}));
  EXPECT_EQ(listed["certificates"][1]["hosts"], json::array({"b"}));
  EXPECT_EQ(pki("list", {"--tsv"}).out.find("NAME\tROLES\tHOSTS\tEXPIRES\tDAYS LEFT\nca\tauthority\t-\t"),
            0u);
  refused("issue", {"solver:c"}, path("ca.key"));
  fs::copy_file(scratch_ / "other" / "ca.key", lab_ / "ca.key");
  refused("issue", {"solver:c"}, path("ca.key") + " is not the key of ca.pem");
}

// While a lab replaces its authority by another, perhaps of the same name.
TEST_F(Pki, TwoAuthoritiesOfOneNameAreToldApart) {
  NEEDS_OPENSSL;
  ASSERT_EQ(pki("init").status, 0);
  ASSERT_EQ(pki("issue", {"solver:old"}).status, 0);
  const std::string next = (scratch_ / "next").string();
  ASSERT_EQ(run_glasswing({"pki", "init", next}).status, 0);
  ASSERT_EQ(run_glasswing({"pki", "issue", next, "solver:new"}).status, 0);
  ASSERT_OK(write_file_durably(lab_ / "both", bytes("ca.pem") + read_file(next + "/ca.pem").value()));
  expect_says(openssl("verify -CAfile both old.pem ../next/new.pem"), "exit 0");
  expect_says(openssl("verify -CAfile ca.pem ../next/new.pem"), "exit 2");
}

// A daemon that uses the certificates.
TEST_F(Pki, ADaemonShowsWhatWasRenewed) {
  ASSERT_EQ(pki("init").status, 0);
  ASSERT_EQ(pki("issue", {"server:rig=127.0.0.1"}).status, 0);
  ASSERT_OK(use_tls({path("ca.pem"), path("rig.pem"), path("rig.key")}));
  const auto host = ServiceHost::start({}, {}).value();
  const auto shown = [&]() -> std::string {
    const auto stub = v1::ClockService::NewStub(dial(host->address()));
    grpc::ClientContext context;
    set_deadline(context, std::chrono::seconds(10));
    v1::ExchangeResponse response;
    const grpc::Status status = stub->Exchange(&context, {}, &response);
    EXPECT_OK(status);
    const auto pem = context.auth_context()->FindPropertyValues(GRPC_X509_PEM_CERT_PROPERTY_NAME);
    return pem.empty() ? "" : std::string(pem.front().data(), pem.front().size());
  };
  EXPECT_EQ(shown(), bytes("rig.pem"));
  ASSERT_OK(CertificateAuthority::open(lab_)->renew("rig", 30));
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (shown() != bytes("rig.pem") && std::chrono::steady_clock::now() < deadline)
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  EXPECT_EQ(shown(), bytes("rig.pem"));
  ASSERT_OK(use_tls({}));
}

}  // namespace
}  // namespace glasswing
