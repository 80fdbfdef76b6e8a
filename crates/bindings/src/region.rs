//! Regions as plain tuples, from which `tautscope.loop.vision.Region` is made.

use tautscope_vision::Region;

/// Centroid u, v [px]; area [px]; left, top, width, height of the box [px].
pub type Described = ((f64, f64), u64, (usize, usize, usize, usize));

/// What Python gets of regions.
pub fn described(regions: &[Region]) -> Vec<Described> {
    let describe = |region: &Region| {
        let [u, v] = region.centroid();
        let sides = (region.right - region.left, region.bottom - region.top);
        let bounds = (region.left, region.top, sides.0, sides.1);
        ((u, v), region.area, bounds)
    };
    regions.iter().map(describe).collect()
}
