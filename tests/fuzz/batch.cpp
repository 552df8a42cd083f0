// Very many variants of a corpus through a fuzz target, without coverage: far faster than
// libFuzzer, which finds the corpora. NAME_batch EXECUTIONS SEED LONGEST FINDING CORPUS… The input
// that ends the program is written to FINDING. Exit code 2: nothing to vary.
#include <fcntl.h>
#include <sanitizer/common_interface_defs.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);
extern "C" const char* __asan_default_options() {  // NOLINT(bugprone-reserved-identifier)
  // Stacks of allocations are printed by the libFuzzer program, with the finding.
  return "handle_abort=1:allocator_may_return_null=1:malloc_context_size=0:quarantine_size_mb=4";
}

namespace {

using Bytes = std::vector<std::uint8_t>;

// Of processor time for kStep inputs; more is a hang.
constexpr itimerval kSlowest{{0, 0}, {20, 0}};
constexpr std::uint64_t kStep = 4096;

Bytes g_input;
const char* g_finding = nullptr;

void keep_finding() {
  const int file = ::open(g_finding, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (file < 0) return;
  (void)!::write(file, g_input.data(), g_input.size());
  ::close(file);
}

/// Changes g_input: numbers at their limits, pieces removed, repeated or of another input.
class Mutator final {
 public:
  Mutator(std::vector<Bytes> corpus, std::uint64_t seed, std::size_t longest)
      : corpus_(std::move(corpus)), random_(seed), longest_(longest) {}

  void next() {
    const Bytes& origin = any();
    g_input.assign(origin.begin(), origin.end());
    for (std::size_t times = 1 + below(4); times > 0; --times) change();
    if (g_input.size() > longest_) g_input.resize(longest_);
  }

 private:
  const Bytes& any() { return corpus_[below(corpus_.size())]; }
  std::size_t below(std::size_t limit) { return limit == 0 ? 0 : random_() % limit; }

  void change() {
    const std::size_t at = below(g_input.size());
    switch (below(g_input.empty() ? 1 : 7)) {
      case 0:
        return insert_of_another(at);
      case 1:
        g_input[at] ^= static_cast<std::uint8_t>(1U << below(8));
        return;
      case 2:
        g_input[at] = static_cast<std::uint8_t>(random_());
        return;
      case 3:
        return put_number(at);
      case 4:
        return g_input.resize(at);
      case 5:
        g_input.erase(offset(at),
                      offset(at + below(std::min<std::size_t>(64, g_input.size() - at))));
        return;
      default:
        return repeat(at);
    }
  }

  static Bytes::iterator offset(std::size_t at) {
    return g_input.begin() + static_cast<std::ptrdiff_t>(at);
  }

  /// A field of 1, 2, 4 or 8 bytes of either order at one of the limits of its type.
  void put_number(std::size_t at) {
    constexpr std::array<std::uint64_t, 8> kLimits{
        0, 1, 0x7f, 0x80, 0x7fff, 0x7fff'ffff, 0x7fff'ffff'ffff'ffff, ~std::uint64_t{0}};
    const std::size_t size = std::min(std::size_t{1} << below(4), g_input.size() - at);
    const std::uint64_t number = kLimits[below(kLimits.size())] + below(3) - 1;
    const bool big_endian = below(2) == 1;
    for (std::size_t i = 0; i < size; ++i) {
      const std::size_t place = big_endian ? size - 1 - i : i;
      g_input[at + place] = static_cast<std::uint8_t>(number >> (8 * i));
    }
  }

  void insert_of_another(std::size_t at) {
    const Bytes& other = any();
    const std::size_t from = below(other.size());
    const std::size_t size = below(std::min<std::size_t>(256, other.size() - from) + 1);
    g_input.insert(offset(at), other.begin() + static_cast<std::ptrdiff_t>(from),
                   other.begin() + static_cast<std::ptrdiff_t>(from + size));
  }

  void repeat(std::size_t at) {
    const std::size_t size = 1 + below(std::min<std::size_t>(64, g_input.size() - at));
    const Bytes piece(offset(at), offset(at + size));
    g_input.insert(offset(at), piece.begin(), piece.end());
  }

  std::vector<Bytes> corpus_;
  std::mt19937_64 random_;
  std::size_t longest_;
};

std::vector<Bytes> read_corpus(int count, char** folders) {
  std::vector<Bytes> corpus;
  for (int i = 0; i < count; ++i) {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folders[i])) {
      if (!entry.is_regular_file()) continue;
      std::ifstream file(entry.path(), std::ios::binary);
      corpus.emplace_back(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
    }
  }
  return corpus;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 6) return 2;
  const std::uint64_t executions = std::strtoull(argv[1], nullptr, 10);
  const std::size_t longest = std::strtoull(argv[3], nullptr, 10);
  g_finding = argv[4];
  auto corpus = read_corpus(argc - 5, argv + 5);
  if (corpus.empty()) return 2;
  const std::size_t inputs = corpus.size();
  Mutator mutator(std::move(corpus), std::strtoull(argv[2], nullptr, 10), longest);
  __sanitizer_set_death_callback(keep_finding);
  (void)std::signal(SIGPROF, [](int) { std::abort(); });
  const auto begin = std::chrono::steady_clock::now();
  for (std::uint64_t i = 0; i < executions; ++i) {
    if (i % kStep == 0) ::setitimer(ITIMER_PROF, &kSlowest, nullptr);
    mutator.next();
    LLVMFuzzerTestOneInput(g_input.data(), g_input.size());
  }
  const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - begin;
  std::printf("%llu executions, %.0f a second, variants of %zu inputs\n",
              static_cast<unsigned long long>(executions),
              static_cast<double>(executions) / passed.count(), inputs);
  return 0;
}
