// Cases that a script runs in Blender, one after another, with the add-on installed.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <nlohmann/json.hpp>
#include <string>

#include "core/file/file.h"
#include "core/image/image_file.h"
#include "tests/compositing/run_glasswing.h"
#include "tests/core/matte/other_program.h"
#include "tests/support/status.h"

namespace glasswing {

class BlenderCases : public ScratchTest {
 protected:
  std::string path(const std::string& name) const { return (scratch_ / name).string(); }
  std::string write_bytes(const std::string& name, const std::string& bytes) const {
    EXPECT_OK(write_file_durably(path(name), bytes));
    return path(name);
  }
  std::string write_picture(const std::string& name, const RadianceImage& picture, Encoding encoding) const {
    EXPECT_OK(write_radiance(path(name), picture, encoding));
    return path(name);
  }

  // Its result is a file of this name; its error, if there is one, is beside it.
  void add_case(const std::string& name, nlohmann::json settings, nlohmann::json others) {
    others.update(
        {{"settings", std::move(settings)}, {"output", path(name)}, {"error", path(name + ".txt")}});
    cases_.push_back(std::move(others));
  }
  void run() const {
    ASSERT_OK(write_file_durably(path("cases.json"), cases_.dump()));
    const Said said = run_program(fmt::format(
        "HOME={0} XDG_CONFIG_HOME={0} blender -b --factory-startup --python-exit-code 1 -P {1} -- {2} "
        "{0}/cases.json",
        scratch_.string(), std::getenv("GLASSWING_BLENDER_SCRIPT"), std::getenv("GLASSWING_BLENDER_ADDON")));
    ASSERT_EQ(said.status, 0) << said.text;
  }
  std::string error_of(const std::string& name) const {
    return read_file(path(name + ".txt")).value_or("no error");
  }

  nlohmann::json cases_ = nlohmann::json::array();
};

}  // namespace glasswing
