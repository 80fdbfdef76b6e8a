/* Counts allocations of the whole process, library included: glibc's functions are replaced by ones that count. */

#ifndef ALLOCATIONS_HPP
#define ALLOCATIONS_HPP

#include <atomic>
#include <cerrno>
#include <cstddef>

namespace allocations {
inline std::atomic<unsigned long> count{0};
}

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define ALLOCATIONS_ARE_COUNTED 1

extern "C" {
void *__libc_malloc(std::size_t size);
void *__libc_calloc(std::size_t number, std::size_t size);
void *__libc_realloc(void *memory, std::size_t size);
void *__libc_memalign(std::size_t alignment, std::size_t size);

void *malloc(std::size_t size) {
    ++allocations::count;
    return __libc_malloc(size);
}

void *calloc(std::size_t number, std::size_t size) {
    ++allocations::count;
    return __libc_calloc(number, size);
}

void *realloc(void *memory, std::size_t size) {
    ++allocations::count;
    return __libc_realloc(memory, size);
}

void *memalign(std::size_t alignment, std::size_t size) {
    ++allocations::count;
    return __libc_memalign(alignment, size);
}

void *aligned_alloc(std::size_t alignment, std::size_t size) {
    ++allocations::count;
    return __libc_memalign(alignment, size);
}

int posix_memalign(void **memory, std::size_t alignment, std::size_t size) {
    ++allocations::count;
    *memory = __libc_memalign(alignment, size);
    return *memory ? 0 : ENOMEM;
}
}
#else
#define ALLOCATIONS_ARE_COUNTED 0
#endif

#endif
