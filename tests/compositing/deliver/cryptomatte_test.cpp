#include "compositing/deliver/cryptomatte.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>

#include "tests/support/status.h"

namespace glasswing {
namespace {

// As published with the hash, and by other implementations.
TEST(Cryptomatte, HashesAreMurmur3) {
  EXPECT_EQ(murmur3_32(""), 0u);
  EXPECT_EQ(murmur3_32("test"), 0xba6bd213u);
  EXPECT_EQ(murmur3_32("hello"), 0x248bfa47u);
  EXPECT_EQ(murmur3_32("Hello, world!"), 0xc0363e43u);
  EXPECT_EQ(murmur3_32("The quick brown fox jumps over the lazy dog"), 0x2e4ff723u);
}

TEST(Cryptomatte, IdsAreNormalNumbers) {
  int flipped = 0;
  for (int i = 0; i < 5000; ++i) {
    const std::string name = "object" + std::to_string(i);
    const float id = std::bit_cast<float>(cryptomatte_id(name));
    EXPECT_TRUE(std::isnormal(id)) << name;
    if (cryptomatte_id(name) != murmur3_32(name)) ++flipped;
  }
  EXPECT_NEAR(flipped, 5000.0 * 2.0 / 256.0, 5.0 * std::sqrt(5000.0 * 2.0 / 256.0));
}

TEST(Cryptomatte, ObjectsThatCannotBeToldApartAreRefused) {
  const std::vector<float> share(6, 0.5f);
  const auto refused = [](std::vector<ObjectShares> objects, const std::string& words) {
    const absl::Status status = encode_cryptomatte(objects, 3, 2).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    EXPECT_NE(status.message().find(words), std::string_view::npos) << status;
  };
  refused({}, "there is no object");
  refused({{"", share}}, "has no name");
  refused({{"vase", share}, {"vase", share}}, "two objects are named \"vase\"");
  refused({{"vase", std::vector<float>(5)}}, "has 5 pixels; the picture has 6");
  EXPECT_OK(encode_cryptomatte(std::vector<ObjectShares>{{"vase", share}}, 3, 2));
}

}  // namespace
}  // namespace glasswing
