// main() of every test program. Takes GoogleTest's options, and `--file NAME_test.cpp` to run the tests of
// one source file. The exit status is 77 if every test skipped.
#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <iostream>
#include <string>

namespace {

// Returns the GoogleTest filter that selects all tests defined in a file of that name.
std::string tests_of(const std::string& file) {
  std::string filter;
  const testing::UnitTest& all = *testing::UnitTest::GetInstance();
  for (int i = 0; i < all.total_test_suite_count(); ++i) {
    const testing::TestSuite& suite = *all.GetTestSuite(i);
    for (int j = 0; j < suite.total_test_count(); ++j) {
      const testing::TestInfo& test = *suite.GetTestInfo(j);
      if (std::filesystem::path(test.file()).filename() != file) continue;
      filter += std::string(suite.name()) + "." + test.name() + ":";
    }
  }
  return filter;
}

}  // namespace

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  if (argc == 3 && std::strcmp(argv[1], "--file") == 0) {
    const std::string filter = tests_of(argv[2]);
    if (filter.empty()) {
      std::cerr << argv[0] << ": no test is defined in a file named " << argv[2] << "\n";
      return 1;
    }
    GTEST_FLAG_SET(filter, filter);
  } else if (argc != 1) {
    std::cerr << "Usage: " << argv[0] << " [--file NAME_test.cpp] [--gtest_...]\n";
    return 1;
  }
  const int failed = RUN_ALL_TESTS();
  const testing::UnitTest& all = *testing::UnitTest::GetInstance();
  const bool nothing_ran =
      all.skipped_test_count() > 0 && all.skipped_test_count() == all.test_to_run_count();
  return failed == 0 && nothing_ran ? 77 : failed;
}
