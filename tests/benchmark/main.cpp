// fiducap_bench VERB [--quick]: costs on this machine; --help lists the verbs.
#include <CLI/CLI.hpp>
#include <utility>
#include <vector>

#include "bench.hpp"

namespace fiducap::bench {
namespace {

struct Verb {
  const char* name;
  const char* what;
  Bench (*add)(CLI::App&, const bool& quick);
};
constexpr Verb kVerbs[] = {
    {"stages", "CPU time of scene and encoders", add_stages},
    {"detection", "tracking regions against libapriltag on whole images", add_detection},
    {"bodies", "a server with many bodies and images on few cores", add_bodies},
    {"loop", "control loops whose only feedback is the stream", add_loop},
    {"fanout", "one scene to twenty clients", add_fanout},
    {"map_store", "size of a map store and time of a commit", add_map_store}};

int run(int argc, char** argv) {
  CLI::App app{"Costs of the server's parts on this machine"};
  bool quick = false;
  app.add_flag("--quick", quick, "enough to see that it works, too little to rely on");
  app.fallthrough();
  app.require_subcommand(1);
  std::vector<std::pair<CLI::App*, Bench>> benches;
  for (const Verb& verb : kVerbs) {
    CLI::App* added = app.add_subcommand(verb.name, verb.what);
    benches.emplace_back(added, verb.add(*added, quick));
  }
  CLI11_PARSE(app, argc, argv);
  for (const auto& [verb, bench] : benches)
    if (verb->parsed()) return bench();
  return 2;
}

}  // namespace
}  // namespace fiducap::bench

int main(int argc, char** argv) { return fiducap::bench::run(argc, argv); }
