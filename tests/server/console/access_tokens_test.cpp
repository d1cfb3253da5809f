#include "server/console/access_tokens.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "core/file/file.h"
#include "server/storage/row_checksums.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

using std::chrono::hours, std::chrono::seconds, std::chrono::sys_seconds;
using Maker = AccessTokens::Maker;

class AccessTokensTest : public testing::Test {
 protected:
  AccessTokens::Made made(const std::string& role = "viewer", const Maker& maker = {"lab"}) {
    return tokens_->make(maker, "anna", role, now_ + hours(1), now_).value();
  }
  Login login(const AccessTokens::Made& token) { return tokens_->log_in(token.secret, now_).value(); }
  bool is_in(const Login& login) { return tokens_->principal_of(login.secret, now_).ok(); }
  void restart() {
    tokens_.reset();
    tokens_ = AccessTokens::open(data_, problems_).value();
  }

  Problems problems_;
  const TemporaryDirectory data_;
  const sys_seconds now_{seconds(1'800'000'000)};
  std::unique_ptr<AccessTokens> tokens_ =
      (std::filesystem::create_directories(data_), AccessTokens::open(data_, problems_).value());
};

TEST_F(AccessTokensTest, ALoginSaysWhoseItIsUntilItsTokenExpires) {
  const Login anna = login(made());
  EXPECT_EQ(anna.principal.name, "anna");
  EXPECT_EQ(anna.principal.roles, only(Role::kViewer));
  EXPECT_EQ(anna.principal.expires, now_ + hours(1));
  EXPECT_EQ(tokens_->principal_of(anna.secret, now_ + hours(1) - seconds(1))->name, "anna");
  EXPECT_EQ(tokens_->principal_of(anna.secret, now_ + hours(1)).status().code(),
            absl::StatusCode::kUnauthenticated);
  EXPECT_EQ(login(made("operator")).principal.roles, only(Role::kOperator));
}

TEST_F(AccessTokensTest, OnlyTheSecretItselfLogsIn) {
  const AccessTokens::Made token = made();
  const Login anna = login(token);
  EXPECT_FALSE(tokens_->log_in(anna.secret, now_).ok()) << "a cookie is no token";
  EXPECT_FALSE(tokens_->principal_of(token.secret, now_).ok()) << "a token is no cookie";
  EXPECT_FALSE(tokens_->log_in(token.token.id, now_).ok());
  EXPECT_FALSE(tokens_->log_in("", now_).ok());
  for (size_t at = 0; at < token.secret.size(); ++at) {
    std::string altered = token.secret;
    altered[at] = altered[at] == '0' ? '1' : '0';
    EXPECT_FALSE(tokens_->log_in(altered, now_).ok()) << at;
  }
}

TEST_F(AccessTokensTest, NoSecretIsStored) {
  const AccessTokens::Made token = made();
  const Login anna = login(token);
  tokens_.reset();  // SQLite writes its log into the file
  const std::string stored = read_file(data_ / kTokensFile).value();
  EXPECT_NE(stored.find(token.token.id), std::string::npos);
  for (const std::string& secret : {token.secret, anna.secret})
    EXPECT_EQ(stored.find(secret), std::string::npos);
}

TEST_F(AccessTokensTest, ALogoutEndsOneLoginOnly) {
  const AccessTokens::Made token = made();
  const Login here = login(token), there = login(token);
  ASSERT_OK(tokens_->log_out(here.secret));
  EXPECT_FALSE(is_in(here));
  EXPECT_OK(tokens_->log_out(here.secret)) << "twice";
  EXPECT_TRUE(is_in(there));
  EXPECT_TRUE(is_in(login(token)));
}

TEST_F(AccessTokensTest, ARevokedTokenTakesItsLoginsAndItsOwnTokensAlong) {
  const AccessTokens::Made root = made("operator"), other = made("operator");
  const AccessTokens::Made child = made("operator", {"anna", sys_seconds::max(), root.token.id});
  const AccessTokens::Made grandchild = made("viewer", {"anna", sys_seconds::max(), child.token.id});
  const std::vector<Login> ended{login(root), login(child), login(grandchild)};
  const Login stays = login(other);
  EXPECT_EQ(tokens_->revoke("nonsense").code(), absl::StatusCode::kNotFound);
  ASSERT_OK(tokens_->revoke(root.token.id));
  for (const Login& each : ended) EXPECT_FALSE(is_in(each));
  for (const AccessTokens::Made* token : {&root, &child, &grandchild})
    EXPECT_FALSE(tokens_->log_in(token->secret, now_).ok());
  EXPECT_TRUE(is_in(stays));
  EXPECT_EQ(tokens_->list(now_)->size(), 1u);
  EXPECT_EQ(tokens_->revoke(root.token.id).code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(tokens_->make({"anna", sys_seconds::max(), root.token.id}, "eve", "viewer", now_ + hours(1), now_)
                .status()
                .code(),
            absl::StatusCode::kUnauthenticated);
}

TEST_F(AccessTokensTest, ATokenEndsNoLaterThanItsMaker) {
  const AccessTokens::Made own = made("operator");
  const Maker with_token{"anna", sys_seconds::max(), own.token.id}, with_certificate{"anna", now_ + hours(2)};
  const auto end_of = [&](const Maker& maker) {
    return tokens_->make(maker, "eve", "operator", now_ + hours(24 * 365), now_)->token.expires;
  };
  EXPECT_EQ(end_of(with_token), now_ + hours(1));
  EXPECT_EQ(end_of(with_certificate), now_ + hours(2));
  EXPECT_EQ(end_of({"machine"}), now_ + hours(24 * 365));
  EXPECT_EQ(tokens_->make({"anna", now_}, "eve", "operator", now_ + hours(1), now_).status().code(),
            absl::StatusCode::kUnauthenticated);
}

TEST_F(AccessTokensTest, TokensAndLoginsSurviveARestart) {
  const AccessTokens::Made token = made();
  const Login anna = login(token), gone = login(token);
  ASSERT_OK(tokens_->log_out(gone.secret));
  restart();
  EXPECT_TRUE(is_in(anna));
  EXPECT_FALSE(is_in(gone));
  EXPECT_OK(tokens_->log_in(token.secret, now_));
  EXPECT_EQ(tokens_->list(now_)->front().login_count, 2);
}

TEST_F(AccessTokensTest, ADamagedFileIsSetAsideAndBrowsersLogInAgain) {
  const AccessTokens::Made token = made();
  tokens_.reset();
  std::string bytes = read_file(data_ / kTokensFile).value();
  bytes[bytes.rfind("viewer")] = 'w';  // an altered row
  ASSERT_OK(write_file_durably(data_ / kTokensFile, bytes));
  restart();
  EXPECT_FALSE(tokens_->log_in(token.secret, now_).ok());
  EXPECT_TRUE(is_in(login(made())));
  EXPECT_EQ(read_file(data_ / "damaged" / kTokensFile).value(), bytes);
  EXPECT_EQ(problems_.all().size(), 1);
  ASSERT_OK(write_file_durably(data_ / kTokensFile, std::string(8192, 'x')));
  restart();
  EXPECT_TRUE(is_in(login(made())));
}

TEST_F(AccessTokensTest, TheirNumberIsLimited) {
  const AccessTokens::Made token = made();
  const Login first = login(token), second = login(token);
  for (int i = 2; i < AccessTokens::kMaxLogins; ++i) login(token);
  EXPECT_TRUE(is_in(first));
  const Login last = login(token);
  EXPECT_FALSE(is_in(first)) << "the oldest ends";
  EXPECT_TRUE(is_in(second));
  EXPECT_TRUE(is_in(last));
  for (int i = 1; i < AccessTokens::kMaxTokens; ++i) made();
  EXPECT_EQ(tokens_->make({"lab"}, "anna", "viewer", now_ + hours(1), now_).status().code(),
            absl::StatusCode::kResourceExhausted);
  const sys_seconds later = now_ + hours(1);  // all have expired
  EXPECT_OK(tokens_->make({"lab"}, "anna", "viewer", later + hours(1), later));
  EXPECT_EQ(tokens_->list(later)->size(), 1u);
}

TEST_F(AccessTokensTest, RefusesWhatATokenCannotSay) {
  const auto code_of = [&](const std::string& name, const std::string& role, sys_seconds expires) {
    return tokens_->make({"lab"}, name, role, expires, now_).status().code();
  };
  EXPECT_EQ(code_of("an na", "viewer", now_ + hours(1)), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(code_of("anna", "server", now_ + hours(1)), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(code_of("anna", "viewer", now_), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(code_of("anna", "viewer", now_ + hours(24 * 366)), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace glasswing
