#pragma once

#include <cstddef>
#include <memory>
#include <mutex>
#include <new>
#include <vector>

namespace fiducap {

/// Hands out objects that come back when the last reader lets go, with the capacity of their
/// vectors kept.
///
/// After warm-up `acquire` allocates nothing: both the object and the control block of its
/// shared_ptr are reused. Thread-safe; the pool may die before its objects.
template <typename T>
class ObjectPool final {
 public:
  /// @return an object as its last user left it; the caller overwrites it before publishing.
  [[nodiscard]] std::shared_ptr<T> acquire() {
    T* object = shelf_->take_object();
    return std::shared_ptr<T>(object, Return{shelf_}, BlockAllocator<T>{shelf_});
  }

 private:
  struct Shelf {
    std::mutex mutex;
    std::vector<std::unique_ptr<T>> objects;
    std::vector<void*> blocks;
    std::size_t block_size{0};

    ~Shelf() {
      for (void* block : blocks) ::operator delete(block);
    }
    T* take_object() {
      {
        const std::lock_guard lock(mutex);
        if (!objects.empty()) {
          T* object = objects.back().release();
          objects.pop_back();
          return object;
        }
      }
      return new T();
    }
    void give_object(T* object) {
      const std::lock_guard lock(mutex);
      objects.emplace_back(object);
    }
    void* take_block(std::size_t size) {
      {
        const std::lock_guard lock(mutex);
        if (size == block_size && !blocks.empty()) {
          void* block = blocks.back();
          blocks.pop_back();
          return block;
        }
        block_size = size;
      }
      return ::operator new(size);
    }
    void give_block(void* block) {
      const std::lock_guard lock(mutex);
      blocks.push_back(block);
    }
  };

  struct Return {
    std::shared_ptr<Shelf> shelf;
    void operator()(T* object) const { shelf->give_object(object); }
  };

  // The control block has one size per T, so one list of equal blocks is enough.
  template <typename U>
  struct BlockAllocator {
    using value_type = U;
    std::shared_ptr<Shelf> shelf;
    explicit BlockAllocator(std::shared_ptr<Shelf> s) : shelf(std::move(s)) {}
    template <typename V>
    BlockAllocator(const BlockAllocator<V>& other)
        : shelf(other.shelf) {}  // NOLINT: allocator rebind
    U* allocate(std::size_t n) { return static_cast<U*>(shelf->take_block(n * sizeof(U))); }
    void deallocate(U* p, std::size_t) { shelf->give_block(p); }
    template <typename V>
    bool operator==(const BlockAllocator<V>& other) const {
      return shelf == other.shelf;
    }
  };

  std::shared_ptr<Shelf> shelf_{std::make_shared<Shelf>()};
};

}  // namespace fiducap
