#include "core/service/joined_calls.h"

#include <gtest/gtest.h>

#include <future>
#include <latch>
#include <thread>

namespace glasswing {
namespace {

using Calls = JoinedCalls<int>;

TEST(JoinedCalls, ARepetitionWaitsForTheFirstAndGetsItsAnswer) {
  Calls calls;
  const grpc::ServerContext context;
  std::latch begun(1), release(1);
  const double before = joined_calls().Value();
  auto first = std::async(std::launch::async, [&] {
    return calls.run(context, "a", [&]() -> Calls::Answer {
      begun.count_down();
      release.wait();
      return 7;
    });
  });
  begun.wait();
  auto second = std::async(std::launch::async,
                           [&] { return calls.run(context, "a", []() -> Calls::Answer { return 8; }); });
  while (joined_calls().Value() == before) std::this_thread::yield();
  // Others do not wait.
  EXPECT_EQ(calls.run(context, "b", []() -> Calls::Answer { return 9; }).value(), 9);
  EXPECT_EQ(calls.run(context, "", []() -> Calls::Answer { return 10; }).value(), 10);
  release.count_down();
  EXPECT_EQ(first.get().value(), 7);
  EXPECT_EQ(second.get().value(), 7);
}

TEST(JoinedCalls, OneThatComesAfterTheEndGetsTheAnswerTooAsLongAsItIsKept) {
  Calls calls(2);
  const grpc::ServerContext context;
  int run = 0;
  const auto call = [&](const std::string& id) {
    return calls.run(context, id, [&]() -> Calls::Answer { return ++run; });
  };
  EXPECT_EQ(call("a").value(), 1);
  EXPECT_EQ(call("a").value(), 1);
  EXPECT_EQ(call("b").value(), 2);
  EXPECT_EQ(call("a").value(), 1);
  EXPECT_EQ(call("c").value(), 3);
  EXPECT_EQ(call("b").value(), 2);
  EXPECT_EQ(call("a").value(), 4) << "only two answers are kept";
  calls.forget("a");
  EXPECT_EQ(call("a").value(), 5);
  Calls forgetful(0);
  EXPECT_EQ(forgetful.run(context, "a", []() -> Calls::Answer { return 1; }).value(), 1);
  EXPECT_EQ(forgetful.run(context, "a", []() -> Calls::Answer { return 2; }).value(), 2);
}

// Kept, an error that has passed (a job store that was away) would be the answer for ever.
TEST(JoinedCalls, AnErrorIsNotKept) {
  Calls calls;
  const grpc::ServerContext context;
  const auto fails = []() -> Calls::Answer { return absl::UnavailableError("the store is away"); };
  EXPECT_TRUE(absl::IsUnavailable(calls.run(context, "a", fails).status()));
  EXPECT_EQ(calls.run(context, "a", []() -> Calls::Answer { return 1; }).value(), 1);
}

}  // namespace
}  // namespace glasswing
