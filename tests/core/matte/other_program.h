// Runs other programs that read our files.
#pragma once

#include <cstdio>
#include <cstdlib>
#include <string>

namespace glasswing {

struct Said {
  int status = 0;
  std::string text;  // standard output and error
};
inline Said run_program(const std::string& command) {
  Said said;
  std::FILE* pipe = ::popen((command + " 2>&1").c_str(), "r");
  char buffer[4096];
  while (const size_t n = std::fread(buffer, 1, sizeof buffer, pipe)) said.text.append(buffer, n);
  said.status = ::pclose(pipe);
  return said;
}

}  // namespace glasswing
