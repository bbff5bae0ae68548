// Style sheet and script of report.html. System fonts, light and dark, from phone to desktop;
// nothing is fetched.
#include "pipeline/report/page_assets.h"

namespace regrade {

const char kReportCss[] = R"css(
:root{color-scheme:light dark;--paper:#fbfaf7;--ink:#22211f;--soft:#6a6862;--line:#dedbd2;--wash:#f1efe8;
--accent:#b4491f;--good:#2f6f4f;--bad:#a3352b;--s0:#7a7770;--s1:#3a6ea5;--s2:#b4491f;--s3:#2f6f4f}
@media(prefers-color-scheme:dark){:root{--paper:#171614;--ink:#e9e6de;--soft:#a09c92;--line:#35332e;--wash:#211f1c;
--accent:#ee8a5b;--good:#7cc39b;--bad:#ef8a80;--s0:#a09c92;--s1:#7fb2e5;--s2:#ee8a5b;--s3:#7cc39b}}
*{box-sizing:border-box}
html{-webkit-text-size-adjust:100%}
body{margin:0;background:var(--paper);color:var(--ink);font:16px/1.55 system-ui,-apple-system,"Segoe UI",Roboto,sans-serif}
main{max-width:68rem;margin:0 auto;padding:2.5rem 1.25rem 5rem}
h1{font:600 2rem/1.2 ui-serif,Georgia,"Times New Roman",serif;margin:0;letter-spacing:-.01em;overflow-wrap:anywhere}
h3{font-size:1.05rem;margin:1.75rem 0 .25rem}
h2{font:600 1.35rem/1.3 ui-serif,Georgia,"Times New Roman",serif;margin:3.25rem 0 .5rem}
p{margin:.4rem 0 1rem;max-width:46rem;overflow-wrap:anywhere}
.soft,figcaption,.facts,.note{color:var(--soft)}
.facts{margin:.35rem 0 1.75rem;font-size:.9rem}
td code{white-space:nowrap;overflow-wrap:normal}
code,pre{font:.85em/1.5 ui-monospace,SFMono-Regular,Menlo,Consolas,monospace;overflow-wrap:anywhere}
pre{background:var(--wash);padding:.9rem 1.1rem;border-radius:.5rem;white-space:pre-wrap}
figure{margin:0;min-width:0}
.note{font-size:.85rem;margin-top:.6rem}
figcaption{font-size:.8rem;margin-top:.3rem;overflow-wrap:anywhere}
img,video{display:block;width:100%;height:auto;border-radius:.4rem;background:var(--wash)}
.compare{display:grid;grid-template-columns:1fr 1fr;gap:.75rem}
.compare input{display:none}
.js .compare{display:block;position:relative;--cut:50%;max-width:var(--fit);margin:0 auto}
.js .compare figure+figure{position:absolute;inset:0;clip-path:inset(0 0 0 var(--cut))}
.js .compare figcaption{position:absolute;bottom:.7rem;margin:0;padding:.1rem .6rem;border-radius:1rem;background:#000a;color:#fff}
.js .compare figure:first-of-type figcaption{left:.7rem}
.js .compare figure+figure figcaption{right:.7rem}
.js .compare::after{content:"";position:absolute;top:0;bottom:0;left:var(--cut);width:2px;margin-left:-1px;background:#fff;box-shadow:0 0 6px #0009;pointer-events:none}
.js .compare input{display:block;position:absolute;inset:0;width:100%;height:100%;margin:0;opacity:0;cursor:ew-resize;z-index:2;touch-action:pan-y}
.js .compare:focus-within{outline:3px solid var(--accent);outline-offset:3px;border-radius:.4rem}
.cards{display:grid;grid-template-columns:repeat(auto-fit,minmax(10.5rem,1fr));gap:1px;background:var(--line);border:1px solid var(--line);border-radius:.5rem;overflow:hidden;margin:1.75rem 0 0;padding:0}
.cards>div{background:var(--paper);padding:.85rem 1rem}
.cards dt{font-size:.8rem;color:var(--soft);line-height:1.35}
.cards dd{margin:.15rem 0 0;font-size:1.45rem;font-weight:600;font-variant-numeric:tabular-nums}
.cards dd small{font-size:.8rem;font-weight:400;color:var(--soft)}.cards dd small+small{display:block}
.views{display:grid;gap:1.5rem}
.view{display:grid;grid-template-columns:repeat(4,1fr);gap:.6rem}
.films{display:grid;grid-template-columns:repeat(auto-fit,minmax(17rem,1fr));gap:1rem;align-items:start}
.films video{max-height:min(75vh,34rem)}
.scroll{overflow-x:auto;margin:.75rem 0 0}
table{border-collapse:collapse;width:100%;font-size:.9rem;font-variant-numeric:tabular-nums}
th,td{padding:.45rem .7rem;text-align:left;vertical-align:top;border-bottom:1px solid var(--line)}
th{font-weight:600;font-size:.8rem;color:var(--soft);vertical-align:bottom}
td:first-child,th:first-child{padding-left:0}
tbody th[scope]{font-size:.9rem;color:var(--ink);vertical-align:top}
.n{text-align:right;white-space:nowrap}
th.n{white-space:normal}
.w{min-width:14rem;overflow-wrap:anywhere}
.file{overflow-wrap:anywhere;min-width:9rem}
.beside{border-left:1px solid var(--line)}
.none{color:var(--soft);border-bottom:1px dotted;cursor:help}
.bar{display:block;height:.35rem;border-radius:.2rem;background:var(--accent);min-width:2px;margin-top:.35rem}
.on,.used{color:var(--good)}.skipped,.unregistered{color:var(--bad)}
.plot{margin-top:1.5rem;max-width:46rem}
.chart{display:block;width:100%;height:auto;font-size:11px}
.chart text{fill:var(--soft)}.chart line{stroke:var(--line)}
.chart polyline{fill:none;stroke-width:1.6;stroke-linejoin:round}
.plot .canvas{position:relative;height:17rem}
.plot.live .chart,.plot.live .legend{display:none}
.map svg{display:block;width:100%;max-width:34rem;height:auto;max-height:34rem;background:var(--wash);border-radius:.4rem}
.map .points{stroke:var(--s0);stroke-width:1.6;stroke-linecap:round;opacity:.45;fill:none}
.map .cam{fill:var(--s1);stroke:var(--s1)}.map .kept{fill:var(--s2);stroke:var(--s2)}
.map path{fill-opacity:.18;stroke-width:1}
.thumbs{display:grid;grid-template-columns:repeat(auto-fill,minmax(6rem,1fr));gap:.6rem;margin-top:.75rem}
.thumbs img{width:100%;height:auto}
.thumb{width:auto;max-width:6rem}
.k0{stroke:var(--s0);fill:var(--s0)}.k1{stroke:var(--s1);fill:var(--s1)}.k2{stroke:var(--s2);fill:var(--s2)}.k3{stroke:var(--s3);fill:var(--s3)}
.legend{overflow-wrap:anywhere;margin-top:.3rem;display:flex;flex-wrap:wrap;gap:.3rem 1.2rem;font-size:.85rem}
.legend i{display:inline-block;width:1.1rem;height:.2rem;margin-right:.4rem;vertical-align:middle}
.legend .k0{background:var(--s0)}.legend .k1{background:var(--s1)}.legend .k2{background:var(--s2)}.legend .k3{background:var(--s3)}
details{margin-top:.75rem}summary{cursor:pointer;color:var(--accent)}
@media(max-width:40rem){.chart{font-size:15px}.plot .canvas{height:15rem}
main{padding:1.5rem 1rem 3rem}h1{font-size:1.6rem}h2{margin-top:2.5rem}
th,td{padding:.4rem .4rem}table{font-size:.85rem}.w{min-width:9rem}
.view{grid-template-columns:1fr 1fr}.cards{grid-template-columns:1fr 1fr}}
@media print{.js .compare{display:grid}.js .compare figure+figure{position:static;clip-path:none}}
)css";

const char kReportScript[] = R"js(
document.documentElement.className='js';
document.addEventListener('input',function(e){var c=e.target.closest('.compare');
if(c)c.style.setProperty('--cut',e.target.value+'%')});
)js";

const char kReportPlotScript[] = R"js(
(function(){
if(!window.Chart)return;
var css=getComputedStyle(document.documentElement);
function ink(name){return css.getPropertyValue(name).trim()}
function axis(title,log){return{type:log?'logarithmic':'linear',title:{display:true,text:title,color:ink('--soft')},
grid:{color:ink('--line')},ticks:{color:ink('--soft'),maxTicksLimit:8}}}
document.querySelectorAll('.plot').forEach(function(figure){
var data=JSON.parse(figure.querySelector('script').textContent);
var box=document.createElement('div'),canvas=document.createElement('canvas');
box.className='canvas';box.appendChild(canvas);figure.insertBefore(box,figure.firstChild);
canvas.setAttribute('role','img');canvas.setAttribute('aria-label',figure.querySelector('svg').getAttribute('aria-label'));
new Chart(canvas,{type:'scatter',data:{datasets:data.series.map(function(s){var colour=ink('--s'+s.colour);return{
label:s.name,labels:s.labels,showLine:!s.dots,borderWidth:1.8,borderColor:colour,backgroundColor:colour,
pointRadius:s.dots?4:0,pointHitRadius:8,
data:s.points.map(function(p){return{x:p[0],y:p[1]}})}})},
options:{animation:false,responsive:true,maintainAspectRatio:false,interaction:{mode:data.series[0].dots?'nearest':'index',intersect:false},
scales:{x:axis(data.x,data.log_x),y:axis(data.y,data.log_y)},
plugins:{legend:{position:'bottom',labels:{color:ink('--ink'),boxWidth:14,boxHeight:2}},
tooltip:{callbacks:{label:function(c){var l=c.dataset.labels&&c.dataset.labels[c.dataIndex];
return(l?l+': ':c.dataset.label+': ')+c.formattedValue}}}}}});
figure.classList.add('live')})})();
)js";

}  // namespace regrade
