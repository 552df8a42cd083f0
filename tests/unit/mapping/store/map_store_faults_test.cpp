// A store after power cuts and on full and failing disks, at every step of a server's life.
#include <gmock/gmock.h>

#include <functional>
#include <optional>
#include <sstream>

#include "mapping/store/map_repair.hpp"
#include "mapping/store/map_store.hpp"
#include "support/fault_disk.hpp"
#include "support/results.hpp"
#include "unit/mapping/map_fixture.hpp"
#include "unit/mapping/store/old_stores.hpp"

namespace fiducap {
namespace {

using test::FaultDisk;
using testing::HasSubstr;
using testing::Not;
using Fault = FaultDisk::Fault;

constexpr const char* kPath = "hall.map";
constexpr std::uint32_t kSeeds = 5;  // everything lost, everything kept, three random choices
constexpr std::int64_t kMinute = 60'000'000'000;

/// The content of a store, for comparisons. Each version is checked against its hash.
std::string state_of(const MapStore& store) {
  std::ostringstream text;
  const auto log = store.log();
  if (!log) return "no log: " + log.error().text();
  for (const auto& one : *log) {
    const auto map = store.load(one.version);
    text << one.version << " of " << one.parent << " " << one.comment << " "
         << (map ? map->hash : map.error().text()) << " with "
         << (map && map->known ? map->known->pairs.size() : 0) << " ties\n";
  }
  const auto learned = store.extrinsics();
  if (!learned) return "no extrinsics: " + learned.error().text();
  for (const auto& one : *learned)
    text << one.body << one.camera << " " << one.X_BV.p.x() << " "
         << (one.clock ? one.clock->shift_s : 0.0) << " " << one.lens.focal.value_or(0) << "\n";
  return text.str();
}

/// One step of a server's life with its store.
using Deed = std::function<Expected<void>(std::optional<MapStore>&)>;

Deed commits(int number, const std::string& comment) {
  return [=](std::optional<MapStore>& store) -> Expected<void> {
    auto before = store->newest();
    if (!before) return tl::unexpected(before.error());
    TagMap map = with_ties(make_map({1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12}));
    map.version = before->version;
    map.tags[0].tag.X_WT.p.x() = number;
    map.created_utc_ns = 1'700'000'000'000'000'000 + number / 2 * 4 * kMinute + number % 2;
    return store->commit(map, comment).map([](const auto&) {});
  };
}

Expected<void> opens(std::optional<MapStore>& store) {
  store.reset();
  return MapStore::open(kPath).map([&](MapStore opened) { store.emplace(std::move(opened)); });
}

Expected<void> thins(std::optional<MapStore>& store) {
  return store->thin().map([](const auto&) {});
}

Deed learns(double shift_s) {
  return [=](std::optional<MapStore>& store) {
    Pose X_BV;
    X_BV.p.x() = 10 * shift_s;
    return store->save_extrinsics(
        {"robot", 0, X_BV, StoredClock{shift_s, 0}, {.focal = 0.1 * shift_s}});
  };
}

struct Life {
  std::string file{};  ///< The initial content.
  std::vector<Deed> deeds{};
};

Life a_life() {
  std::vector<Deed> deeds{opens, commits(0, "survey")};
  for (int i = 1; i <= 9; ++i) {
    deeds.push_back(commits(i, kAutomaticComment));
    if (i % 2 == 0) deeds.push_back(thins);
    if (i % 4 == 0) deeds.push_back(learns(0.1 * i));
    if (i == 5) deeds.push_back(opens);  // closed and opened again
  }
  return {.deeds = std::move(deeds)};
}

/// A store of an older server is migrated and used.
Life a_life_after(const OldSchema& schema) {
  FaultDisk disk;
  std::optional<MapStore> store;
  EXPECT_TRUE(opens(store));
  for (int i = 0; i < 4; ++i) EXPECT_TRUE(commits(i, i < 2 ? "kept" : kAutomaticComment)(store));
  EXPECT_TRUE(learns(0.2)(store));
  store.reset();
  EXPECT_TRUE(make_old(kPath, schema.number));
  return {disk.content(kPath),
          {opens, commits(4, kAutomaticComment), thins, opens, commits(5, kAutomaticComment)}};
}

/// The content of the store after each step without faults, and before the first one.
struct Reference {
  Life life;
  std::vector<std::string> states{""};
  std::uint64_t steps{};
  std::uint64_t reads{};
};

void begin(FaultDisk& disk, const Life& life) {
  if (!life.file.empty()) disk.set_content(kPath, life.file);
}

Reference run_without_fault(Life life) {
  Reference reference;
  if (!life.file.empty()) {
    FaultDisk disk;
    disk.set_content(kPath, life.file);
    const auto before = MapStore::open_to_read(kPath);
    EXPECT_TRUE(before);
    reference.states.front() = state_of(*before);
  }
  FaultDisk disk;
  begin(disk, life);
  std::optional<MapStore> store;
  for (const Deed& deed : life.deeds) {
    EXPECT_TRUE(deed(store));
    reference.states.push_back(state_of(*store));
  }
  store.reset();
  reference.steps = disk.steps();
  reference.reads = disk.reads();
  reference.life = std::move(life);
  return reference;
}

/// @param which  0: a new store; else one of kOldSchemas
const Reference& reference_of(std::size_t which) {
  static const std::vector<Reference> all = [] {
    std::vector<Reference> made{run_without_fault(a_life())};
    for (const OldSchema& schema : kOldSchemas)
      made.push_back(run_without_fault(a_life_after(schema)));
    return made;
  }();
  return all[which];
}

void expect_explained(const Error& error) {
  EXPECT_EQ(error.code, ErrorCode::kUnavailable) << error.text();
  EXPECT_GT(error.what.size(), 20u);
}

void live_with(std::uint64_t step, Fault fault, const Reference& reference);

class MapStoreFaults : public testing::TestWithParam<std::size_t> {
 protected:
  [[nodiscard]] const Reference& reference() const { return reference_of(GetParam()); }
  /// The fault at every step, or at every read.
  void live_with_each(Fault fault) const {
    const std::uint64_t count = fault == Fault::kReadFails ? reference().reads : reference().steps;
    for (std::uint64_t step = 0; step < count; ++step) {
      SCOPED_TRACE(step);
      ASSERT_NO_FATAL_FAILURE(live_with(step, fault, reference()));
    }
  }
};
INSTANTIATE_TEST_SUITE_P(Life, MapStoreFaults,
                         testing::Range(std::size_t{0}, 1 + kOldSchemas.size()));

TEST(MapStoreLives, ThinAndCheckpoint) {
  const Reference& reference = reference_of(0);
  EXPECT_GT(reference.steps, 100u);
  EXPECT_THAT(reference.states.back(), HasSubstr("survey"));
  EXPECT_THAT(reference.states.back(), HasSubstr("\n4 of 2 "));
  EXPECT_THAT(reference.states.back(), Not(HasSubstr("\n3 of"))) << "thinned";
  EXPECT_THAT(reference.states.back(), HasSubstr(" with 11 ties\n"));
}

TEST(MapStoreLives, MigrateAnOldStore) {
  const Reference& reference = reference_of(kOldSchemas.size());
  EXPECT_GT(reference.steps, 20u);
  EXPECT_THAT(reference.states.front(), Not(HasSubstr(" with 11 ties\n")));
  EXPECT_EQ(reference.states[1], reference.states.front());
  EXPECT_THAT(reference.states.back(), HasSubstr(" with 11 ties\n"));
}

TEST_P(MapStoreFaults, LosesAtMostOneStepByAPowerCut) {
  for (std::uint64_t step = 0; step < reference().steps; ++step) {
    FaultDisk disk;
    begin(disk, reference().life);
    disk.fail_at(step, Fault::kPowerCut);
    std::optional<MapStore> store;
    std::size_t done = 0;
    for (const Deed& deed : reference().life.deeds) {
      if (const auto result = deed(store); !result) {
        expect_explained(result.error());
        break;
      }
      ++done;
    }
    store.reset();
    ASSERT_TRUE(disk.has_failed());
    for (std::uint32_t seed = 0; seed < kSeeds; ++seed) {
      SCOPED_TRACE("step " + std::to_string(step) + " seed " + std::to_string(seed));
      disk.reboot(seed < 2 ? seed : seed + 1000 * static_cast<std::uint32_t>(step));
      value_of(opens(store));
      const std::string state = state_of(*store);
      const auto& states = reference().states;
      if (state != states[done]) {
        ASSERT_LT(done + 1, states.size());
        ASSERT_EQ(state, states[done + 1]) << "before it was\n" << states[done];
      }
      ASSERT_TRUE(commits(99, "afterwards")(store));
      store.reset();
    }
  }
}

/// Runs a life with a fault at `step`; failed steps are repeated after the fault is removed.
void live_with(std::uint64_t step, Fault fault, const Reference& reference) {
  FaultDisk disk;
  begin(disk, reference.life);
  disk.fail_at(step, fault);
  std::optional<MapStore> store;
  std::size_t done = 0;
  bool reported = false;
  for (const Deed& deed : reference.life.deeds) {
    auto result = deed(store);
    if (!result) {
      expect_explained(result.error());
      reported = true;
      disk.recover();
      if (store) {
        ASSERT_EQ(state_of(*store), reference.states[done]) << result.error().text();
      }
      result = deed(store);
      ASSERT_TRUE(result) << "again: " << result.error().text();
      ASSERT_EQ(state_of(*store), reference.states[done + 1]);
    }
    disk.recover();  // faults between steps: SQLite also writes by itself
    ++done;
  }
  ASSERT_EQ(state_of(*store), reference.states.back());
  // All of it is on the disk.
  disk.fail_at(0, Fault::kPowerCut);
  store.reset();
  disk.reboot(static_cast<std::uint32_t>(step + 2));
  value_of(opens(store));
  EXPECT_EQ(state_of(*store), reference.states.back()) << (reported ? "reported" : "not reported");
}

TEST_P(MapStoreFaults, ReportsAndSurvivesAFullDisk) { live_with_each(Fault::kFull); }
TEST_P(MapStoreFaults, ReportsAndSurvivesAFailedSync) { live_with_each(Fault::kSyncFails); }
TEST_P(MapStoreFaults, ReportsAndSurvivesAFailedWrite) { live_with_each(Fault::kWriteFails); }
TEST_P(MapStoreFaults, ReportsAndSurvivesAFailedRead) { live_with_each(Fault::kReadFails); }

// --- repair ---

constexpr const char* kPart = "hall.map.salvage";

/// A store with a destroyed page, as bytes.
std::string a_damaged_store() {
  FaultDisk disk;
  std::optional<MapStore> store;
  EXPECT_TRUE(opens(store));
  for (int i = 0; i < 8; ++i) EXPECT_TRUE(commits(i, "kept")(store));
  EXPECT_TRUE(learns(0.2)(store));
  store.reset();
  std::string bytes = disk.content(kPath);
  const std::size_t page = bytes.size() / 2 / 4096 * 4096;
  std::fill_n(bytes.begin() + static_cast<std::ptrdiff_t>(page), 4096, 'x');
  return bytes;
}

TEST(MapRepairFaults, KeepTheDamagedStoreAndReportWholeOnesOnly) {
  const std::string damaged = a_damaged_store();
  std::uint64_t steps = 0;
  std::string state;
  {
    FaultDisk disk;
    disk.set_content(kPath, damaged);
    ASSERT_FALSE(MapStore::open(kPath));
    const auto found = value_of(salvage_map_store(kPath, kPart));
    EXPECT_FALSE(found.is_sound());
    EXPECT_GT(found.sound.size(), 4u);
    steps = disk.steps();
    state = state_of(*MapStore::open(kPart));
  }
  EXPECT_GT(steps, 10u);
  for (const Fault fault :
       {Fault::kPowerCut, Fault::kFull, Fault::kSyncFails, Fault::kWriteFails}) {
    for (std::uint64_t step = 0; step <= steps; ++step) {
      SCOPED_TRACE(std::to_string(static_cast<int>(fault)) + " at " + std::to_string(step));
      FaultDisk disk;
      disk.set_content(kPath, damaged);
      disk.fail_at(step, fault);
      const bool reported = salvage_map_store(kPath, kPart).has_value();
      if (!disk.has_failed()) disk.fail_at(0, Fault::kPowerCut);
      disk.reboot(static_cast<std::uint32_t>(step));
      EXPECT_TRUE(disk.content(kPath) == damaged);
      if (reported) {
        const auto repaired = value_of(MapStore::open(kPart));
        EXPECT_EQ(state_of(repaired), state);
      }
    }
  }
}

}  // namespace
}  // namespace fiducap
