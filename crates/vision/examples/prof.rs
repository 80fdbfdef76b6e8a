use tautscope_vision::*;
use std::time::Instant;
fn main() {
    for name in ["/tmp/twin1080.bgr","/tmp/colon1080.bgr"] {
    let d=std::fs::read(name).unwrap();
    let f=Image::new(&d,PixelFormat::Bgr,[1920,1080],5760).unwrap();
    let disc=ColorDiscriminant::new([-0.2,1.0,-0.8],10.0).unwrap();
    for passes in [0,1] {
    let mut s=Segmenter::new(disc,passes);
    let mut det=Detector::new(Settings{discriminant:disc,smoothing:passes,minimum_area:40,gate:100.0,entry_point:[0.0,0.0]}).unwrap();
    let mut t=vec![]; let mut n=0;
    for _ in 0..100 { let a=Instant::now(); n=0; s.each_row(&f,|_,r| r.each(|a,b| n+=b-a)); t.push(a.elapsed().as_secs_f64()*1e6); }
    t.sort_by(f64::total_cmp);
    let mut t2=vec![]; 
    for _ in 0..100 { let a=Instant::now(); det.detect(&f,None); t2.push(a.elapsed().as_secs_f64()*1e6); }
    t2.sort_by(f64::total_cmp);
    let r:Vec<_>=det.detect(&f,None).regions.iter().take(2).copied().collect();
    let ws:Vec<_>=r.iter().map(|r| Window{left:r.left.saturating_sub(30),top:r.top.saturating_sub(30),right:r.right+30,bottom:r.bottom+30}).collect();
    let mut t3=vec![]; 
    for _ in 0..100 { let a=Instant::now(); det.regions_in(&f,&ws); t3.push(a.elapsed().as_secs_f64()*1e6); }
    t3.sort_by(f64::total_cmp);
    println!("{name} {passes} seg {:.0} {:.0} det {:.0} {:.0}  win {:.1} {:.1} px {n}",t[50],t[0],t2[50],t2[0],t3[50],t3[0]);
    }}
}
