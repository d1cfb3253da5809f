// --layout auto on synthetic photographs of every layout, and on what it must refuse.
#include "client/layouts/layout_guess.h"

#include <algorithm>

#include "tests/client/layouts/synthetic_stack.h"
#include "tests/client/run_glasswing.h"

namespace glasswing {
namespace {

class LayoutGuesses : public ScratchTest {
 protected:
  // The options of the layout that is believed, or the error.
  std::string guess(const std::vector<Shown>& stack, const View& view = {}, const LayoutFacts& facts = {}) {
    const std::filesystem::path folder = scratch_ / std::to_string(++folders_);
    const std::vector<std::string> files =
        write_stack(folder, stack, view, [](size_t i) { return fmt::format("{:03d}.png", i); });
    v1::Monitor monitor;
    monitor.set_width_px(kStackWidth_px);
    monitor.set_height_px(kStackHeight_px);
    const LayoutGuess guessed = guess_layout(sample_stack(folder, files).value(), files, monitor, facts);
    reasons_ = fmt::format("{}", fmt::join(guessed.reasons, "\n"));
    return guessed.layout.ok() ? options_of(*guessed.layout) : std::string(guessed.layout.status().message());
  }
  static LayoutFacts periods(const std::string& text) { return {.periods = periods_of(text).value()}; }

  std::string reasons_;
  int folders_ = 0;
};

void add(std::vector<Shown>& stack, const std::vector<Shown>& more) {
  stack.insert(stack.end(), more.begin(), more.end());
}

TEST_F(LayoutGuesses, BarsOfEitherCodeInAnyOrder) {
  struct Case {
    bool gray;
    int complements;
    std::string order;
  };
  for (const Case& each : {Case{true, 1, "columns,rows,white,black"},
                           {true, 1, "white,black,rows,columns"},
                           {true, -1, "columns,black,white,rows"},
                           {true, 0, "rows,columns"},
                           {true, 0, "white,columns,rows"},
                           {false, 0, "white,rows,columns"},
                           {false, 1, "columns,rows"},
                           {false, 1, "black,columns,rows,white"}}) {
    std::vector<Shown> stack;
    std::istringstream words(each.order);
    for (std::string word; std::getline(words, word, ',');) {
      if (word == "white" || word == "black") {
        stack.push_back(uniform(word == "white" ? 1.0 : 0.0));
      } else {
        add_bits(stack, each.gray, word == "rows" ? 1 : 0, each.complements);
      }
    }
    const char* inverse = each.complements == 0 ? "none" : each.complements > 0 ? "after" : "before";
    const std::string expected = fmt::format("--layout {} --order {} --inverse {}",
                                             each.gray ? "opencv-graycode" : "binary", each.order, inverse);
    EXPECT_EQ(guess(stack, {.gamma = 2.2, .noise = 2.0}), expected);
    EXPECT_NE(reasons_.find("this is " + expected), std::string::npos) << reasons_;
    EXPECT_EQ(guess(stack, {.mirrored = true}), expected);
    EXPECT_NE(reasons_.find("a mirrored view"), std::string::npos) << reasons_;
  }
}

TEST_F(LayoutGuesses, ABinaryCodeUpsideDownIsItsComplement) {
  for (const bool gray : {true, false}) {
    std::vector<Shown> stack;
    add_bits(stack, gray, 0, 0);
    add_bits(stack, gray, 1, 0);
    const std::string guessed = guess(stack, {.upside_down = true});
    if (gray) {
      EXPECT_EQ(guessed, "--layout opencv-graycode --order columns,rows --inverse none");
      EXPECT_NE(reasons_.find("upside down"), std::string::npos) << reasons_;
    } else {
      EXPECT_NE(guessed.find("lit bars of the binary code mean 0"), std::string::npos) << guessed;
    }
  }
}

TEST_F(LayoutGuesses, FringesOfAnyNumberOfSteps) {
  for (const int steps : {3, 4, 5, 8}) {
    for (const bool solids : {true, false}) {
      std::vector<Shown> stack;
      if (solids) stack = {uniform(1.0), uniform(0.0)};
      add_steps(stack, 1, {1, 6}, steps, false);
      add_steps(stack, 0, {1, 6}, steps, false);
      const std::string expected =
          fmt::format("--layout phase-shift --order {}rows,columns --steps {} --periods 1,6 --shift forward",
                      solids ? "white,black," : "", steps);
      // The monitor's or the camera's curve bends the waves.
      const View view{.gamma = solids ? 2.0 : 1.0};
      EXPECT_EQ(guess(stack, view, periods("1,6")), expected) << reasons_;
    }
  }
  std::vector<Shown> columns;
  add_steps(columns, 0, {1, 4, 16}, 4, false);
  EXPECT_EQ(guess(columns, {}, periods("64px,16px,4px")),
            "--layout phase-shift --order columns --steps 4 --periods 64px,16px,4px --shift forward");
}

TEST_F(LayoutGuesses, WhatFringesDoNotShowIsAskedFor) {
  std::vector<Shown> stack;
  add_steps(stack, 0, {1, 6}, 4, true);
  add_steps(stack, 1, {1, 6}, 4, true);
  EXPECT_NE(guess(stack).find("along x their frequencies are in the ratio 1.00 : 6"), std::string::npos);
  EXPECT_NE(guess(stack, {}, periods("1,6,36")).find("--periods names 3 fringes, the photographs show 2"),
            std::string::npos);
  EXPECT_NE(guess(stack, {}, periods("1,7")).find("those given are in the ratio 1.00 : 7.00"),
            std::string::npos);
  EXPECT_NE(guess(stack, {}, periods("1,6")).find("pass --shift forward or --shift backward"),
            std::string::npos);
  LayoutFacts facts = periods("1,6");
  facts.backward = true;
  EXPECT_NE(guess(stack, {}, facts).find("--shift backward"), std::string::npos) << reasons_;
  std::vector<Shown> forward;
  add_steps(forward, 0, {1, 6}, 4, false);
  add_steps(forward, 1, {1, 6}, 4, false);
  EXPECT_NE(guess(forward, {.mirrored = true}, periods("1,6")).find("--shift forward"), std::string::npos);
  EXPECT_NE(reasons_.find("mirrored view"), std::string::npos) << reasons_;
}

TEST_F(LayoutGuesses, WhatIsNotUnderstoodIsRefused) {
  std::vector<Shown> fine_first;
  add_bits(fine_first, true, 0, 0);
  std::ranges::reverse(fine_first);
  add_bits(fine_first, true, 1, 0);
  EXPECT_NE(guess(fine_first).find("no standard layout explains these 12 photographs"), std::string::npos);

  std::vector<Shown> both_reversed;
  add_bits(both_reversed, true, 0, 0);
  std::vector<Shown> rows;
  add_bits(rows, true, 1, 0);
  std::ranges::reverse(rows);
  add(both_reversed, rows);
  const std::string coarser = guess(both_reversed);
  EXPECT_NE(coarser.find("should show horizontal bars"), std::string::npos) << coarser;

  std::vector<Shown> one_more = both_reversed;
  add(one_more, std::vector<Shown>(3, uniform(0.5)));
  EXPECT_NE(guess(one_more).find("explains these 15 photographs"), std::string::npos);

  EXPECT_NE(guess(std::vector<Shown>(14, uniform(0.0)), {.noise = 1.0}).find("less than 0.2 % of the frame"),
            std::string::npos);

  std::vector<Shown> inverses;
  for (const int axis : {0, 1}) {
    for (int bit = kStackBits - 1; bit >= 0; --bit) inverses.push_back(bit_shown(true, axis, bit, true));
  }
  EXPECT_NE(guess(inverses).find("complements of a Gray code, without the code itself"), std::string::npos);

  // Shuffled photographs of a known layout are not that layout.
  std::vector<Shown> shuffled;
  add_bits(shuffled, false, 0, 1);
  add_bits(shuffled, false, 1, 1);
  std::ranges::shuffle(shuffled, std::mt19937(3));
  EXPECT_NE(guess(shuffled).find("name the layout, or what each photograph shows with --list"),
            std::string::npos);
}

}  // namespace
}  // namespace glasswing
