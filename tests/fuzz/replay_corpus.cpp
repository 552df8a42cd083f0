// Runs every file of the given folders once through a fuzz target: fuzz_corpus TARGET FOLDER…
// Exit code 1: nothing to run.
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <map>
#include <string>
#include <vector>

using Target = int(const std::uint8_t*, std::size_t);

// Every target of CMakeLists.txt, under its own name.
#define X(name) extern "C" Target name;
#include "fuzz_targets.inc"
#undef X

int main(int argc, char** argv) {
#define X(name) {#name, &name},
  const std::map<std::string, Target*> targets{
#include "fuzz_targets.inc"
  };
#undef X
  const auto target = argc > 1 ? targets.find(argv[1]) : targets.end();
  if (target == targets.end()) {
    std::cerr << "fuzz_corpus TARGET FOLDER…, with one of\n";
    for (const auto& [name, run] : targets) std::cerr << name << "\n";
    return 1;
  }
  int runs = 0;
  for (int i = 2; i < argc; ++i) {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(argv[i])) {
      if (!entry.is_regular_file()) continue;
      std::ifstream file(entry.path(), std::ios::binary);
      const std::vector<char> bytes((std::istreambuf_iterator<char>(file)),
                                    std::istreambuf_iterator<char>());
      target->second(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
      ++runs;
    }
  }
  std::cout << runs << " inputs\n";
  return runs > 0 ? 0 : 1;
}
