#pragma once

#include <cstdio>
#include <string>

namespace fiducap {

/// Output and success of a shell command, run where the calling thread is.
struct Shell {
  bool done{};
  std::string output;
};

inline Shell shell(const std::string& command) {
  Shell result;
  std::FILE* pipe = ::popen((command + " 2>&1").c_str(), "r");
  if (pipe == nullptr) return result;
  char buffer[256];
  while (std::fgets(buffer, sizeof(buffer), pipe) != nullptr) result.output += buffer;
  result.done = ::pclose(pipe) == 0;
  return result;
}

}  // namespace fiducap
